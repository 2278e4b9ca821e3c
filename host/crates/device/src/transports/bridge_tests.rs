use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};

use tokio::io::{AsyncReadExt, AsyncWriteExt};

use super::*;

/// A device at the other end of two channels: what it sends, in packets; what it is sent.
struct Packets(Receiver<io::Result<Vec<u8>>>);

impl BlockingRead for Packets {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let Ok(packet) = self.0.recv_timeout(READ_PATIENCE) else { return Ok(0) };
        let packet = packet?;
        into[..packet.len()].copy_from_slice(&packet);
        Ok(packet.len())
    }
}

/// Takes this many bytes at once, and reports when it is released.
struct Taker {
    taken: Arc<Mutex<Vec<u8>>>,
    at_once: usize,
    outcomes: VecDeque<io::Result<usize>>,
    released: Sender<()>,
}

impl BlockingWrite for Taker {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let most = self.outcomes.pop_front().unwrap_or(Ok(self.at_once))?;
        let taken = &bytes[..bytes.len().min(most)];
        self.taken.lock().expect("nobody panics").extend(taken);
        Ok(taken.len())
    }
}

impl Drop for Taker {
    fn drop(&mut self) {
        let _ = self.released.send(());
    }
}

struct World {
    line: Bridge,
    device: Sender<io::Result<Vec<u8>>>,
    taken: Arc<Mutex<Vec<u8>>>,
    released: Receiver<()>,
}

fn world(at_once: usize, outcomes: impl IntoIterator<Item = io::Result<usize>>) -> World {
    let (device, packets) = channel();
    let (release, released) = channel();
    let taken = Arc::new(Mutex::new(Vec::new()));
    let outcomes = outcomes.into_iter().collect();
    let taker = Taker { taken: taken.clone(), at_once, outcomes, released: release };
    let line = Bridge::start(Packets(packets), taker).expect("threads");
    World { line, device, taken, released }
}

fn bytes(length: usize) -> Vec<u8> {
    (0..length).map(|at| (at * 7 % 251) as u8).collect()
}

#[tokio::test]
async fn bytes_go_both_ways_in_order() {
    let mut world = world(63, [Ok(0), Ok(1), Ok(0)]);
    let sent = bytes(300_000);
    for packet in sent.chunks(511) {
        world.device.send(Ok(packet.to_vec())).unwrap();
    }
    let mut read = vec![0; sent.len()];
    world.line.read_exact(&mut read).await.unwrap();
    assert_eq!(read, sent);
    world.line.write_all(&sent).await.unwrap();
    drop(world.line);
    world.released.recv().unwrap();
    assert_eq!(*world.taken.lock().unwrap(), sent, "what was written before the end has left");
}

#[tokio::test]
async fn what_has_come_is_read_before_the_loss_is_told() {
    let mut world = world(63, []);
    world.device.send(Ok(bytes(100))).unwrap();
    world.device.send(Err(io::Error::new(io::ErrorKind::NotConnected, "pulled out"))).unwrap();
    let mut read = Vec::new();
    let lost = world.line.read_to_end(&mut read).await.expect_err("the loss is an error, not an end");
    assert_eq!((lost.kind(), lost.to_string().as_str()), (io::ErrorKind::NotConnected, "pulled out"));
    assert_eq!(read, bytes(100));
    let unwritten = world.line.write_all(&bytes(10)).await.expect_err("nobody takes it");
    assert_eq!(unwritten.kind(), io::ErrorKind::NotConnected);
}

#[tokio::test]
async fn a_loss_met_while_writing_ends_the_reading_too() {
    let mut world = world(63, [Err(io::Error::other("no longer there"))]);
    world.line.write_all(&bytes(10)).await.unwrap();
    let lost = world.line.read(&mut [0; 16]).await.expect_err("the loss");
    assert_eq!(lost.to_string(), "no longer there");
}

#[tokio::test]
async fn a_line_that_is_dropped_releases_its_device() {
    let World { line, device, released, .. } = world(63, []);
    // More than fits: the reading thread waits for space when the line is dropped.
    for _ in 0..40 {
        device.send(Ok(bytes(4_096))).unwrap();
    }
    drop(line);
    released.recv_timeout(Duration::from_secs(20)).expect("the writing half goes");
    // The reading half goes as well: its receiver is dropped.
    let began = std::time::Instant::now();
    while device.send(Ok(Vec::new())).is_ok() {
        assert!(began.elapsed() < Duration::from_secs(20), "the reading half goes");
        std::thread::yield_now();
    }
}
