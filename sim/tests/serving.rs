//! Serving in real time. Nothing here asserts how long anything takes; every wait ends when the thing waited for
//! happens.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use armature_sim::serve::{Background, Options, Place, ServeSettings};
use armature_sim::{Body, Motion, Puppet, PuppetSettings};
use firmware_protocol::{Decoder, DeviceMessage, FrameBuffer, HostMessage};

fn puppet(preset: &str) -> Puppet {
    let motion = Motion::WalkAndWave;
    Puppet::new(PuppetSettings { motion, ..PuppetSettings::new(Body::preset(preset, 3).unwrap()) }).unwrap()
}

struct Host<Line> {
    line: Line,
    decoder: Decoder,
    buffer: Vec<u8>,
}

impl<Line: Read + Write> Host<Line> {
    fn new(line: Line) -> Self {
        Self { line, decoder: Decoder::new(), buffer: vec![0; 4096] }
    }

    fn say(&mut self, message: HostMessage) {
        let mut wire = FrameBuffer::new();
        self.line.write_all(&[0]).unwrap();
        self.line.write_all(wire.encode(&message).unwrap()).unwrap();
    }

    /// Reads until enough messages match; returns what was taken from them.
    fn hear<T>(&mut self, count: usize, mut take: impl FnMut(DeviceMessage<'_>) -> Option<T>) -> Vec<T> {
        let mut taken = Vec::new();
        while taken.len() < count {
            let got = self.line.read(&mut self.buffer).unwrap();
            assert!(got > 0, "the line is still there");
            let mut bytes = &self.buffer[..got];
            while let Some(frame) = self.decoder.next_frame(&mut bytes) {
                taken.extend(take(DeviceMessage::parse(frame).unwrap()));
            }
        }
        taken
    }

    fn stream(&mut self, samples: usize) -> Vec<(u32, u64)> {
        self.say(HostMessage::HELLO_REQUEST);
        self.hear(1, |m| if let DeviceMessage::Hello(_) = m { Some(()) } else { None });
        self.say(HostMessage::SetRate { rate_millihertz: 1_000_000 });
        self.hear(1, |m| if let DeviceMessage::RateSet(_) = m { Some(()) } else { None });
        self.say(HostMessage::Start);
        self.hear(
            samples,
            |m| if let DeviceMessage::Sample(s) = m { Some((s.sequence, s.device_micros)) } else { None },
        )
    }
}

fn assert_complete(samples: &[(u32, u64)]) {
    let first = samples[0];
    assert_eq!(first.0, 0);
    for (index, (sequence, micros)) in samples.iter().enumerate() {
        assert_eq!(*sequence, index as u32);
        assert_eq!(*micros, first.1 + 1000 * index as u64);
    }
}

#[cfg(unix)]
fn open(address: &str) -> Host<File> {
    let path = address.strip_prefix("serial:").unwrap();
    Host::new(OpenOptions::new().read(true).write(true).open(path).unwrap())
}

#[cfg(unix)]
#[test]
fn a_thousand_samples_a_second_over_a_pseudo_terminal() {
    let server = Background::start(puppet("joints:32"), Place::Pty, ServeSettings::default()).unwrap();
    let mut host = open(server.address());
    assert_complete(&host.stream(1500));
    // The host disconnects in the middle of the stream and comes back.
    drop(host);
    let mut host = open(server.address());
    host.say(HostMessage::HELLO_REQUEST);
    host.hear(1, |m| if let DeviceMessage::Hello(_) = m { Some(()) } else { None });
    host.say(HostMessage::Start);
    host.say(HostMessage::Stop);
    host.hear(1, |m| match m {
        DeviceMessage::Acknowledge(done) if done.request == 5 => Some(()),
        _ => None,
    });
    let report = server.finish().unwrap();
    assert_eq!(report.frames_dropped, 0);
    assert!(report.truth.samples_sent >= 1500);
}

#[cfg(unix)]
#[test]
fn nobody_reading_costs_frames_and_nothing_else() {
    let settings = ServeSettings { buffer_bytes: 4096, ..ServeSettings::default() };
    let server = Background::start(puppet("joints:149"), Place::Pty, settings).unwrap();
    let mut host = open(server.address());
    host.stream(1);
    let sequence = |m: DeviceMessage<'_>| if let DeviceMessage::Sample(s) = m { Some(s.sequence) } else { None };
    let missing = |all: &[u32]| all.windows(2).map(|pair| pair[1] - pair[0] - 1).sum::<u32>();
    let mut sequences = Vec::new();
    while missing(&sequences) == 0 {
        // The terminal's and the server's buffers fill while nobody reads.
        std::thread::sleep(Duration::from_millis(200));
        sequences.extend(host.hear(200, sequence));
        assert!(sequences.windows(2).all(|pair| pair[0] < pair[1]), "the rest is whole and in order");
    }
    assert_eq!(host.decoder.counters().checksum_errors + host.decoder.counters().framing_errors, 0);
    let report = server.finish().unwrap();
    assert!(report.frames_dropped >= u64::from(missing(&sequences)));
}

#[test]
fn one_host_after_the_other_over_tcp() {
    let place = Place::Tcp("127.0.0.1:0".into());
    let server = Background::start(puppet("human"), place, ServeSettings::default()).unwrap();
    let address = server.address().strip_prefix("tcp:").unwrap().to_owned();
    for _ in 0..3 {
        let mut host = Host::new(TcpStream::connect(&address).unwrap());
        assert_complete(&host.stream(50));
    }
    let report = server.finish().unwrap();
    assert!(report.truth.requests >= 9);
}

#[test]
fn the_plug_is_pulled() {
    let settings = ServeSettings { unplug_after: Some(Duration::from_millis(30)), ..ServeSettings::default() };
    let server = Background::start(puppet("hand"), Place::Tcp("127.0.0.1:0".into()), settings).unwrap();
    let address = server.address().strip_prefix("tcp:").unwrap().to_owned();
    if let Ok(mut line) = TcpStream::connect(&address) {
        let mut rest = Vec::new();
        // Whoever wins the race, the line ends.
        drop(line.read_to_end(&mut rest));
    }
    server.finish().unwrap();
    assert!(TcpStream::connect(&address).is_err());
}

#[test]
fn a_place_that_cannot_be_is_an_error() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let place = Place::Tcp(taken.local_addr().unwrap().to_string());
    let error = Background::start(puppet("hand"), place, ServeSettings::default()).unwrap_err();
    assert!(error.to_string().contains("cannot listen on"), "{error}");
    assert!(Options::default().puppet().is_ok());
}
