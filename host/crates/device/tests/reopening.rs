//! The cable is pulled and plugged in again, over real pseudo terminals.

#![cfg(unix)]

mod common;
mod served;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use armature_device::{Connection, ConnectionSettings, DeviceAddress, DeviceNotice, DeviceProblem, Event, PartUid};
use common::{FakeDevice, puppet};
use served::{Served, pseudo_terminal};
use tokio::runtime::Handle;

/// A socket for a cable: a path that leads to whatever is plugged in.
struct Socket {
    folder: PathBuf,
    path: PathBuf,
}

impl Socket {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("armature-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("the system allows it");
        Self { path: folder.join("port"), folder }
    }

    fn address(&self) -> DeviceAddress {
        format!("serial:{}", self.path.display()).parse().expect("the system allows it")
    }

    fn plug(&self, device: FakeDevice) -> Plugged {
        let (master, slave, path) = pseudo_terminal();
        let served = Served::on(master, device);
        std::os::unix::fs::symlink(path, &self.path).expect("the system allows it");
        Plugged { served, slave, path: self.path.clone() }
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

struct Plugged {
    served: Served,
    slave: std::fs::File,
    path: PathBuf,
}

impl Plugged {
    fn pull(self) -> FakeDevice {
        std::fs::remove_file(&self.path).expect("the system allows it");
        drop(self.slave);
        self.served.unplug()
    }
}

async fn next(connection: &mut Connection) -> Event {
    let event = tokio::time::timeout(Duration::from_secs(20), connection.next()).await.expect("an event in time");
    event.expect("the connection stands")
}

async fn until(connection: &mut Connection, wanted: impl Fn(&Event) -> bool) -> Vec<Event> {
    let mut events = Vec::new();
    loop {
        let event = next(connection).await;
        let found = wanted(&event);
        events.push(event);
        if found {
            return events;
        }
    }
}

fn is_sample(event: &Event) -> bool {
    matches!(event, Event::Sample(_))
}

/// The port is looked for every 20 ms, and hello, topology, rate and start take a few more. `ARMATURE_FULL_SOAK` pulls
/// a hundred times.
#[tokio::test]
async fn a_cable_pulled_and_plugged_in_again_streams_again_by_itself() {
    let socket = Socket::new("pulled");
    let mut plugged = socket.plug(FakeDevice::new(puppet(17)));
    let settings = ConnectionSettings::default();
    let mut connection = Connection::open(&Handle::current(), &socket.address(), settings).await.unwrap();
    connection.start(500_000);
    until(&mut connection, is_sample).await;
    let times = if std::env::var_os("ARMATURE_FULL_SOAK").is_some() { 100 } else { 12 };
    let mut took = Vec::new();
    for _ in 0..times {
        plugged.pull();
        let lost = until(&mut connection, |event| matches!(event, Event::Notice(DeviceNotice::LineLost { .. }))).await;
        assert!(!lost.iter().any(|event| matches!(event, Event::Problem(_))), "{lost:?}");
        // The device had no power meanwhile: its clock and its numbers begin anew.
        plugged = socket.plug(FakeDevice::new(puppet(17)));
        let back = Instant::now();
        let events = until(&mut connection, is_sample).await;
        took.push(back.elapsed());
        let told: Vec<&Event> = events.iter().filter(|event| !matches!(event, Event::Clock(_))).collect();
        assert!(
            matches!(
                told[..],
                [
                    Event::Notice(DeviceNotice::LineBack { .. }),
                    Event::Restarted,
                    Event::Connected(_),
                    Event::Topology(_),
                    Event::RateGranted { .. },
                    Event::Started,
                    Event::Sample(_),
                ]
            ),
            "{told:?}"
        );
    }
    took.sort();
    println!("streaming again after {:?} (median), {:?} (worst) of {times}", took[times / 2], took[times - 1]);
    assert!(took[times / 2] <= Duration::from_millis(500), "{took:?}");
    assert_eq!(connection.close().await.connections, times as u64 + 1);
}

#[tokio::test]
async fn another_device_at_the_same_port_is_named_and_not_taken() {
    let socket = Socket::new("foreign");
    let plugged = socket.plug(FakeDevice::new(puppet(3)));
    let settings = ConnectionSettings::default();
    let mut connection = Connection::open(&Handle::current(), &socket.address(), settings).await.unwrap();
    connection.start(100_000);
    until(&mut connection, is_sample).await;
    plugged.pull();
    until(&mut connection, |event| matches!(event, Event::Notice(DeviceNotice::LineLost { .. }))).await;
    let mut other = FakeDevice::new(puppet(3));
    other.uid = PartUid([9; 12]);
    let foreign = socket.plug(other);
    let is_foreign = |event: &Event| matches!(event, Event::Problem(DeviceProblem::AnotherDevice { .. }));
    let events = until(&mut connection, is_foreign).await;
    assert!(!events.iter().any(|event| matches!(event, Event::Connected(_) | Event::Sample(_))), "{events:?}");
    foreign.pull();
    let plugged = socket.plug(FakeDevice::new(puppet(3)));
    let events = until(&mut connection, is_sample).await;
    assert!(!events.iter().any(is_foreign), "{events:?}");
    connection.close().await;
    plugged.pull();
}

#[tokio::test]
async fn a_connection_can_be_closed_while_the_cable_is_out() {
    let socket = Socket::new("closed");
    let plugged = socket.plug(FakeDevice::new(puppet(3)));
    let settings = ConnectionSettings::default();
    let mut connection = Connection::open(&Handle::current(), &socket.address(), settings).await.unwrap();
    connection.start(100_000);
    until(&mut connection, is_sample).await;
    plugged.pull();
    until(&mut connection, |event| matches!(event, Event::Notice(DeviceNotice::LineLost { .. }))).await;
    let closed = tokio::time::timeout(Duration::from_secs(5), connection.close()).await;
    assert!(closed.is_ok());
}

#[tokio::test]
async fn where_that_is_not_wanted_a_lost_line_ends_the_connection() {
    let socket = Socket::new("ended");
    let plugged = socket.plug(FakeDevice::new(puppet(3)));
    let settings = ConnectionSettings { reopen: false, ..ConnectionSettings::default() };
    let mut connection = Connection::open(&Handle::current(), &socket.address(), settings).await.unwrap();
    connection.start(100_000);
    until(&mut connection, is_sample).await;
    plugged.pull();
    until(&mut connection, |event| matches!(event, Event::Problem(DeviceProblem::Disconnected { .. }))).await;
    assert_eq!(connection.next().await, None);
}
