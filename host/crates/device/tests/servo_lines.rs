//! Arms of servos over real pseudo terminals, at the real speed of the bus.

#![cfg(unix)]

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use armature_device::{Connection, ConnectionSettings, DeviceAddress, DeviceNotice, Event, SensorState};
use armature_sim::serve;
use armature_sim::servo::{ServoBus, ServoBusSettings, ServoBusTruth};
use tokio::runtime::Handle;

struct Arm {
    address: String,
    stop: Arc<AtomicBool>,
    thread: std::thread::JoinHandle<ServoBusTruth>,
}

impl Arm {
    fn serve(name: &str, change: impl FnOnce(&mut ServoBusSettings)) -> Self {
        let mut settings = ServoBusSettings::preset(name, 1).expect("an arm");
        change(&mut settings);
        let bus = ServoBus::new(settings).expect("a bus");
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, receiver) = std::sync::mpsc::channel();
        let stop_of_thread = stop.clone();
        let thread = std::thread::spawn(move || {
            let ready = |address: &str| sender.send(address.to_owned()).expect("the test listens");
            serve::bus(bus, &stop_of_thread, ready).expect("a pseudo terminal")
        });
        Self { address: receiver.recv().expect("an address"), stop, thread }
    }

    fn pull(self) -> ServoBusTruth {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().expect("it does not panic")
    }
}

async fn next(connection: &mut Connection) -> Event {
    let event = tokio::time::timeout(Duration::from_mins(2), connection.next()).await.expect("an event in time");
    event.expect("the connection is open")
}

#[tokio::test]
async fn both_kinds_of_arm_stream_over_a_pseudo_terminal() {
    for name in ["so101-leader", "koch-leader"] {
        let arm = Arm::serve(name, |_| ());
        let address: DeviceAddress = format!("{},{name}", arm.address).parse().unwrap();
        let settings = ConnectionSettings::default();
        let mut connection = Connection::open(&Handle::current(), &address, settings).await.unwrap();
        connection.start(100_000);
        let (mut readings, mut good) = (0, 0);
        let mut began = None;
        while readings < 200 {
            match next(&mut connection).await {
                Event::Connected(info) => assert!(info.name.contains("leader arm"), "{}", info.name),
                Event::Sample(sample) => {
                    began.get_or_insert_with(Instant::now);
                    readings += 1;
                    good += sample.states.iter().filter(|&&state| state == SensorState::Ok).count();
                }
                Event::Problem(problem) => panic!("{name}: {problem}"),
                _ => {}
            }
        }
        let rate = 199.0 / began.map_or(f64::INFINITY, |began| began.elapsed().as_secs_f64());
        println!("{name}: {rate:.0} readings a second, {good} of {} good", readings * 6);
        assert!(good > 199 * 5, "{name}: {good}");
        connection.close().await;
        assert_eq!(arm.pull().eeprom_writes, 0);
    }
}

#[tokio::test]
async fn an_arm_at_another_speed_is_found_by_setting_the_line() {
    let arm = Arm::serve("koch-leader", |bus| bus.baud = 57_600);
    let address: DeviceAddress = arm.address.parse().unwrap();
    let mut connection = Connection::open(&Handle::current(), &address, ConnectionSettings::default()).await.unwrap();
    connection.start(20_000);
    let mut told = false;
    loop {
        match next(&mut connection).await {
            Event::Notice(DeviceNotice::FoundAtBaud { asked: 1_000_000, found: 57_600 }) => told = true,
            Event::Sample(_) => break,
            Event::Problem(problem) => panic!("{problem}"),
            _ => {}
        }
    }
    assert!(told);
    connection.close().await;
    assert!(arm.pull().bytes_at_wrong_speed > 0, "it was asked at another speed first");
}
