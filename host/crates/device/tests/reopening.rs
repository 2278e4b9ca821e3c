//! The cable is pulled and plugged in again, over real pseudo terminals.

#![cfg(unix)]

mod common;
mod served;

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use armature_device::{
    Connection, ConnectionSettings, DeviceAddress, DeviceDescription, DeviceNotice, DeviceProblem, Event, PartUid,
    UsbDescription,
};
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
    let event = tokio::time::timeout(Duration::from_mins(2), connection.next()).await.expect("an event in time");
    event.expect("the connection is open")
}

async fn until(connection: &mut Connection, mut wanted: impl FnMut(&Event) -> bool) -> Vec<Event> {
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

/// The port is checked for every 20 ms, and hello, topology, rate and start take a few more. `ARMATURE_FULL_SOAK`
/// unplugs a hundred times.
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
        // The device had no power meanwhile: its clock and its numbers start over.
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
    let closed = tokio::time::timeout(Duration::from_secs(20), connection.close()).await;
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

/// Serial ports of boards, listed as the operating system lists those on USB.
#[derive(Clone, Default)]
struct Boards(Arc<Mutex<Vec<DeviceDescription>>>);

struct Board {
    served: Served,
    slave: std::fs::File,
    path: String,
}

const CH340: (u16, u16) = (0x1A86, 0x7523);
const PICO: (u16, u16) = (0x1209, 0x0001);
const FT232: (u16, u16) = (0x0403, 0x6001);

impl Boards {
    /// Plugs a board in under a new name.
    fn plug(&self, (vendor_id, product_id): (u16, u16), serial_number: Option<&str>, device: FakeDevice) -> Board {
        let (master, slave, path) = pseudo_terminal();
        self.list((vendor_id, product_id), serial_number, &path);
        Board { served: Served::on(master, device), slave, path }
    }

    fn list(&self, (vendor_id, product_id): (u16, u16), serial_number: Option<&str>, path: &str) {
        let usb = UsbDescription {
            vendor_id,
            product_id,
            manufacturer: None,
            product: None,
            serial_number: serial_number.map(str::to_owned),
        };
        let address = address_of(path);
        self.0.lock().expect("no test fails with it").push(DeviceDescription {
            address,
            port: path.to_owned(),
            usb: Some(usb),
        });
    }

    fn pull(&self, board: Board) -> FakeDevice {
        self.0.lock().expect("no test fails with it").retain(|port| port.port != board.path);
        drop(board.slave);
        board.served.unplug()
    }

    /// Streams from this board, and looks for it among these when it is lost.
    async fn stream(&self, board: &Board, settings: ConnectionSettings) -> Connection {
        let ports = self.clone();
        let list = move || ports.0.lock().expect("no test fails with it").clone();
        let mut connection = Connection::open_among(&Handle::current(), &address_of(&board.path), settings, list)
            .await
            .expect("it can be opened");
        connection.start(100_000);
        until(&mut connection, is_sample).await;
        connection
    }
}

fn address_of(path: &str) -> DeviceAddress {
    format!("serial:{path}").parse().expect("an address")
}

/// A puppet whose root has this number.
fn numbered(number: u8) -> FakeDevice {
    let mut device = FakeDevice::new(puppet(3));
    device.uid = PartUid([number; 12]);
    device
}

async fn until_lost(connection: &mut Connection) {
    until(connection, |event| matches!(event, Event::Notice(DeviceNotice::LineLost { .. }))).await;
}

fn is_problem(event: &Event) -> bool {
    matches!(event, Event::Problem(_))
}

/// Boards copied with their USB serial number, or without any, are told apart by the puppet's own number.
#[tokio::test]
async fn of_boards_that_usb_cannot_tell_apart_the_right_puppet_is_found_again_at_whatever_port() {
    for (kind, serial_number) in [(PICO, Some("0001")), (CH340, None)] {
        let boards = Boards::default();
        let first = boards.plug(kind, serial_number, numbered(1));
        let second = boards.plug(kind, serial_number, numbered(2));
        let third = boards.plug(kind, serial_number, numbered(3));
        let mut connection = boards.stream(&second, ConnectionSettings::default()).await;
        // Behind the others in the list, and under another name, since its own is still taken.
        let again = boards.plug(kind, serial_number, numbered(2));
        boards.pull(second);
        until_lost(&mut connection).await;
        let events = until(&mut connection, is_sample).await;
        let told: Vec<&Event> = events.iter().filter(|event| !matches!(event, Event::Clock(_))).collect();
        let [
            Event::Notice(back @ DeviceNotice::LineBack { at: Some(at), .. }),
            Event::Restarted,
            Event::Connected(info),
            ..,
        ] = told[..]
        else {
            panic!("{told:?}")
        };
        assert!(at == &again.path && back.to_string().ends_with(&format!("now at {at}")), "{back}");
        assert_eq!(info.uid, PartUid([2; 12]));
        assert!(!events.iter().any(is_problem), "{events:?}");
        assert_eq!(connection.close().await.restarts, 0);
        for (board, number) in [(first, 1), (third, 3)] {
            let device = boards.pull(board);
            assert!(!device.streaming, "puppet {number} was asked who it is and no more");
        }
        boards.pull(again);
    }
}

#[tokio::test]
async fn where_only_other_puppets_are_left_they_are_named_and_the_right_one_is_awaited() {
    let boards = Boards::default();
    let mut other = numbered(1);
    other.name = "somebody else's";
    let other = boards.plug(PICO, Some("0001"), other);
    let mine = boards.plug(PICO, Some("0001"), numbered(2));
    let mut connection = boards.stream(&mine, ConnectionSettings::default()).await;
    boards.pull(mine);
    until_lost(&mut connection).await;
    let events = until(&mut connection, is_problem).await;
    let Some(Event::Problem(problem @ DeviceProblem::AnotherDevice { .. })) = events.last() else {
        panic!("{events:?}")
    };
    let named = format!("somebody else's at serial:{}", other.path);
    assert!(problem.to_string().contains(&named), "{problem}");
    assert!(
        !events.iter().any(|event| matches!(event, Event::Connected(_) | Event::Notice(DeviceNotice::LineBack { .. })))
    );
    let mine = boards.plug(PICO, Some("0001"), numbered(2));
    let events = until(&mut connection, is_sample).await;
    assert!(!events.iter().any(is_problem), "{events:?}");
    connection.close().await;
    boards.pull(mine);
    boards.pull(other);
}

/// Another board of the kind may run anything, or nothing.
#[tokio::test]
async fn a_board_that_says_nothing_does_not_hold_up_the_search() {
    let boards = Boards::default();
    let (_master, _slave, mute) = pseudo_terminal();
    boards.list(CH340, None, &mute);
    let mine = boards.plug(CH340, None, numbered(2));
    let mut connection = boards.stream(&mine, ConnectionSettings::default()).await;
    boards.pull(mine);
    until_lost(&mut connection).await;
    tokio::time::sleep(Duration::from_millis(100)).await; // the other one is being asked
    let mine = boards.plug(CH340, None, numbered(2));
    let events = until(&mut connection, is_sample).await;
    let is_back = |event: &&Event| matches!(event, Event::Notice(DeviceNotice::LineBack { .. }) | Event::Restarted);
    assert_eq!(events.iter().filter(is_back).count(), 2, "{events:?}");
    connection.close().await;
    boards.pull(mine);
}

/// A number that was not known yet, because the root did not answer, is no other puppet's.
#[tokio::test]
async fn a_puppet_that_did_not_know_its_number_yet_is_not_another_one() {
    let boards = Boards::default();
    let mine = boards.plug(PICO, Some("0002"), numbered(0));
    let mut connection = boards.stream(&mine, ConnectionSettings::default()).await;
    boards.pull(mine);
    until_lost(&mut connection).await;
    let mine = boards.plug(PICO, Some("0002"), numbered(2));
    let events = until(&mut connection, is_sample).await;
    assert!(!events.iter().any(is_problem), "{events:?}");
    connection.close().await;
    boards.pull(mine);
}

/// The device's side of an adapter that passes bytes on every 16 ms.
struct Adapter<L> {
    line: L,
    held: VecDeque<u8>,
    passed_on: Instant,
}

impl<L: Read> Read for Adapter<L> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.line.read(buffer)
    }
}

impl<L: Write> Write for Adapter<L> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.held.extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        if self.passed_on.elapsed() >= Duration::from_millis(16) {
            self.passed_on = Instant::now();
            self.line.write_all(self.held.make_contiguous())?;
            self.held.clear();
        }
        Ok(())
    }
}

#[tokio::test]
async fn an_adapter_that_holds_bytes_back_is_named_with_what_to_do() {
    for (kind, is_told) in [(FT232, true), (CH340, false)] {
        let boards = Boards::default();
        let (master, slave, path) = pseudo_terminal();
        boards.list(kind, Some("A50285BI"), &path);
        let adapter = Adapter { line: master, held: VecDeque::new(), passed_on: Instant::now() };
        let board = Board { served: Served::on(adapter, numbered(2)), slave, path };
        let mut settings = ConnectionSettings::default();
        settings.session.ping_every = Duration::from_millis(50);
        let mut connection = boards.stream(&board, settings).await;
        let mut samples = 0;
        let events = until(&mut connection, |event| {
            samples += usize::from(is_sample(event));
            samples == 100
        })
        .await;
        let told: Vec<&Event> = events.iter().filter(|event| matches!(event, Event::Notice(_))).collect();
        match told[..] {
            [] => assert!(!is_told),
            [Event::Notice(notice @ DeviceNotice::AdapterHoldsBytes { port, .. })] => {
                let words = notice.to_string();
                let name = board.path.rsplit('/').next().unwrap();
                assert!(is_told && *port == board.path && words.contains(&format!("{name}/latency_timer")), "{words}");
            }
            _ => panic!("{told:?}"),
        }
        connection.close().await;
        boards.pull(board);
    }
}
