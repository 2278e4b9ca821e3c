//! `armature devices`

use armature_device::servo::ServoArm;

use crate::failure::Failure;

/// Lists the serial ports of this machine with what may be behind them, the arms of servos that are known, and the
/// simulated puppets.
pub fn devices() -> Result<(), Failure> {
    let ports = armature_device::list_serial_ports()
        .map_err(|e| Failure::device(e.to_string(), "give the port by its path: --device serial:PATH"))?;
    if ports.is_empty() {
        println!("No serial port is there. Plug the puppet in, or use a simulated one:");
    }
    for port in &ports {
        let usb = port.usb.as_ref().map_or_else(String::new, |usb| {
            let words = [&usb.manufacturer, &usb.product, &usb.serial_number];
            let words: Vec<&str> = words.into_iter().flatten().map(String::as_str).collect();
            format!("  USB {:04x}:{:04x}  {}", usb.vendor_id, usb.product_id, words.join(" · "))
        });
        println!("{:32}{usb}", port.guessed_address().to_string());
    }
    for arm in ServoArm::presets() {
        let address = format!("{}:PATH,{}", arm.protocol.scheme(), arm.name);
        println!("{address:32}  {} ({} servos at {} baud)", arm.title, arm.joints.len(), arm.baud);
    }
    println!("{:32}  simulated human", "sim:human");
    println!("{:32}  simulated spider", "sim:spider");
    println!("{:32}  simulated hand", "sim:hand");
    println!("{:32}  a puppet with a joint for each bone of a motion file", "sim:FILE.bvh");
    Ok(())
}
