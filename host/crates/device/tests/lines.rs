//! Connections over real lines: memory, TCP and a pseudo terminal.

#![cfg(unix)]

mod common;
mod served;

use std::net::TcpListener;
use std::time::{Duration, Instant};

use armature_device::{Connection, DeviceAddress, DeviceNotice, DeviceProblem, Event, SessionSettings, memory, open};
use common::{FakeDevice, puppet};
use served::{Served, pseudo_terminal};
use tokio::runtime::Handle;

/// The next event that says something about the device.
async fn next(connection: &mut Connection) -> Event {
    loop {
        let event = tokio::time::timeout(Duration::from_mins(2), connection.next()).await.expect("an event in time");
        match event.expect("the connection is open") {
            // On a busy machine the device may take a second to answer.
            Event::Clock(_) | Event::Notice(DeviceNotice::WaitsForStart) => {}
            event => return event,
        }
    }
}

/// Hello to samples, and a clean stop.
async fn go_through(mut connection: Connection) -> armature_device::SessionCounters {
    connection.start(500_000);
    assert!(matches!(next(&mut connection).await, Event::Connected(info) if info.name == "fake"));
    assert!(matches!(next(&mut connection).await, Event::Topology(tree) if tree.sensor_count == 51));
    assert!(matches!(next(&mut connection).await, Event::RateGranted { granted_millihertz: 500_000, .. }));
    assert_eq!(next(&mut connection).await, Event::Started);
    for sequence in 0..200 {
        let event = next(&mut connection).await;
        let Event::Sample(sample) = event else { panic!("{event:?}") };
        assert_eq!(sample.sequence, sequence, "no sample is lost");
        assert!(connection.began() + sample.received <= Instant::now());
    }
    connection.stop();
    while next(&mut connection).await != Event::Stopped {}
    connection.close().await
}

#[tokio::test]
async fn a_pseudo_terminal_carries_a_session() {
    let (master, slave, path) = pseudo_terminal();
    let device = Served::on(master, FakeDevice::new(puppet(17)));
    let address: DeviceAddress = format!("serial:{path}@3000000").parse().unwrap();
    let connection = Connection::spawn(&Handle::current(), open(&address).await.unwrap(), SessionSettings::default());
    let counters = go_through(connection).await;
    assert_eq!((counters.lost_samples, counters.discarded_bytes), (0, 0));
    assert_eq!(counters.samples, u64::from(device.unplug().taken), "every sample taken has arrived");
    drop(slave);
}

#[tokio::test]
async fn tcp_carries_a_session() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address: DeviceAddress = format!("tcp:{}", listener.local_addr().unwrap()).parse().unwrap();
    let line = open(&address).await.unwrap();
    let (peer, _) = listener.accept().unwrap();
    peer.set_nonblocking(true).unwrap();
    let device = Served::on(peer, FakeDevice::new(puppet(17)));
    let counters = go_through(Connection::spawn(&Handle::current(), line, SessionSettings::default())).await;
    assert_eq!(counters.samples, u64::from(device.unplug().taken));
}

/// Time is virtual here: it advances when all tasks wait.
#[tokio::test(start_paused = true)]
async fn memory_carries_a_session_on_virtual_time() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let (here, mut there) = memory();
    tokio::spawn(async move {
        let mut device = FakeDevice::new(puppet(17));
        let began = tokio::time::Instant::now();
        let mut buffer = [0; 4_096];
        loop {
            if let Ok(read) = tokio::time::timeout(Duration::from_millis(1), there.read(&mut buffer)).await {
                match read {
                    Ok(0) | Err(_) => return,
                    Ok(length) => device.hear(began.elapsed(), &buffer[..length]),
                }
            }
            device.step(began.elapsed());
            if there.write_all(&device.take_outgoing()).await.is_err() {
                return;
            }
        }
    });
    let mut connection = Connection::spawn(&Handle::current(), here, SessionSettings::default());
    connection.start(1_000_000);
    let mut samples = 0;
    while samples < 60_000 {
        match next(&mut connection).await {
            Event::Sample(sample) => {
                assert_eq!(sample.sequence, samples, "no sample of a minute at 1,000 Hz is lost");
                samples += 1;
            }
            Event::Lost { .. } | Event::Problem(_) | Event::Noise { .. } => panic!("a quiet line"),
            _ => {}
        }
    }
    let counters = connection.close().await;
    assert_eq!((counters.lost_samples, counters.restarts), (0, 0));
}

/// When the far end of a pseudo-terminal closes, reads return 0 bytes forever; that must end the connection.
#[tokio::test]
async fn an_unplugged_device_ends_the_connection() {
    let (master, slave, path) = pseudo_terminal();
    let device = Served::on(master, FakeDevice::new(puppet(17)));
    let address: DeviceAddress = format!("serial:{path}").parse().unwrap();
    let line = open(&address).await.unwrap();
    let mut connection = Connection::spawn(&Handle::current(), line, SessionSettings::default());
    connection.start(100_000);
    while !matches!(next(&mut connection).await, Event::Sample(_)) {}
    drop(slave);
    device.unplug();
    let mut last = None;
    while let Some(event) =
        tokio::time::timeout(Duration::from_mins(2), connection.next()).await.expect("the connection ends")
    {
        last = Some(event);
    }
    assert!(matches!(last, Some(Event::Problem(DeviceProblem::Disconnected { .. }))), "{last:?}");
    assert_eq!(connection.close().await.connections, 1, "closing what has ended is fine");
}

#[tokio::test]
async fn a_dropped_connection_stops_the_device() {
    let (here, there) = std::os::unix::net::UnixStream::pair().unwrap();
    here.set_nonblocking(true).unwrap();
    there.set_nonblocking(true).unwrap();
    let device = Served::on(there, FakeDevice::new(puppet(2)));
    let line = tokio::net::UnixStream::from_std(here).unwrap();
    let mut connection = Connection::spawn(&Handle::current(), line, SessionSettings::default());
    connection.start(100_000);
    while !matches!(next(&mut connection).await, Event::Sample(_)) {}
    drop(connection);
    let device = tokio::task::spawn_blocking(|| device.join()).await.unwrap().expect("the line is closed");
    assert!(!device.streaming, "it was stopped before the line was closed");
}

#[tokio::test]
async fn a_closed_connection_does_not_wait_for_events_nobody_takes() {
    let (here, there) = std::os::unix::net::UnixStream::pair().unwrap();
    here.set_nonblocking(true).unwrap();
    there.set_nonblocking(true).unwrap();
    let mut device = FakeDevice::new(puppet(1));
    device.max_rate_millihertz = 100_000_000;
    let device = Served::on(there, device);
    let line = tokio::net::UnixStream::from_std(here).unwrap();
    let mut connection = Connection::spawn(&Handle::current(), line, SessionSettings::default());
    connection.start(100_000_000);
    while !matches!(next(&mut connection).await, Event::Sample(_)) {}
    while connection.counters().samples < 4_000 {
        tokio::task::yield_now().await;
    }
    let closed = tokio::time::timeout(Duration::from_mins(2), connection.close()).await;
    assert!(closed.is_ok_and(|counters| counters.samples >= 4_000));
    device.unplug();
}

#[tokio::test]
async fn ports_that_cannot_be_opened_say_why() {
    let problem = |text: &str| {
        let address: DeviceAddress = text.parse().unwrap();
        async move { open(&address).await.err().expect("cannot be opened") }
    };
    let missing = problem("serial:/dev/ttyNOWHERE").await;
    assert_eq!(missing, DeviceProblem::PortMissing { port: "/dev/ttyNOWHERE".into() });
    assert!(matches!(problem("serial:/dev/null").await, DeviceProblem::NotASerialPort { .. }));
    assert!(matches!(problem("sim:human").await, DeviceProblem::SimulatedHere { .. }));
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    assert!(matches!(problem(&format!("tcp:{free}")).await, DeviceProblem::Unreachable { .. }));

    let (_master, _slave, path) = pseudo_terminal();
    let address: DeviceAddress = format!("serial:{path}").parse().unwrap();
    let first = open(&address).await.unwrap();
    // An administrator may open a port twice; its lock is detected all the same.
    assert_eq!(problem(&format!("serial:{path}")).await, DeviceProblem::PortBusy { port: path });
    drop(first);
}

#[test]
fn ports_can_be_listed() {
    let ports = armature_device::list_serial_ports().expect("a list, even if empty");
    assert!(ports.iter().all(|port| port.address.to_string().contains(&port.port)));
}
