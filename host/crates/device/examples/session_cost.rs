//! What a session costs for each sample of 32 three-axis joints: bytes in, events out.
//!
//! `cargo run --release -p armature-device --example session_cost`

use std::time::{Duration, Instant};

use armature_device::{Event, Part, PartKind, PartUid, SensorState, Session, SessionSettings};
use firmware_protocol::{
    Acknowledge, FrameBuffer, Hello, RateSet, SampleMessage, TopologyMessage, message_type, topology_messages,
};

const JOINTS: u8 = 32;
const SENSORS: usize = 3 * JOINTS as usize;
const SAMPLES: u32 = 100_000;

fn main() -> Result<(), firmware_protocol::EncodeError> {
    let mut session = Session::new(SessionSettings::default());
    let mut events = Vec::new();
    session.start(1_000_000);
    session.tick(Duration::ZERO, &mut events);
    let mut frame = FrameBuffer::new();
    let hello = Hello {
        protocol_major: 1,
        protocol_minor: 0,
        features: 0,
        firmware: [1, 0, 0],
        uid: PartUid([0; 12]),
        max_rate_millihertz: 1_000_000,
        name: "example",
    };
    session.receive(Duration::ZERO, frame.encode(&hello)?, &mut events);
    let parts: Vec<Part> = (0..JOINTS).map(joint).collect();
    for message in topology_messages(1, &parts).collect::<Vec<TopologyMessage<'_>>>() {
        session.receive(Duration::ZERO, frame.encode(&message)?, &mut events);
    }
    session.receive(Duration::ZERO, frame.encode(&RateSet { rate_millihertz: 1_000_000 })?, &mut events);
    session.receive(Duration::ZERO, frame.encode(&Acknowledge { request: message_type::START })?, &mut events);
    assert_eq!(events.last(), Some(&Event::Started));

    let mut seconds = Vec::with_capacity(SAMPLES as usize);
    for sequence in 0..SAMPLES {
        let counts: [u16; SENSORS] = std::array::from_fn(|sensor| (sequence as usize * 7 + sensor * 641) as u16);
        let message = SampleMessage {
            device_micros: u64::from(sequence) * 1_000,
            sequence,
            epoch: 1,
            counts: &counts,
            states: &[SensorState::Ok; SENSORS],
        };
        let bytes = frame.encode(&message)?;
        events.clear();
        let started = Instant::now();
        session.receive(Duration::from_millis(u64::from(sequence)), bytes, &mut events);
        seconds.push(started.elapsed().as_secs_f64());
        session.take_outgoing();
    }
    assert_eq!(session.counters().samples, u64::from(SAMPLES));
    seconds.sort_by(f64::total_cmp);
    for (name, at) in [("median", 0.5), ("p99", 0.99), ("p99.99", 0.9999)] {
        println!("{name:7} {:7.2} µs a sample of {SENSORS} sensors", seconds[(SAMPLES as f64 * at) as usize] * 1e6);
    }
    Ok(())
}

fn joint(number: u8) -> Part {
    Part {
        kind: PartKind::TwistBendTwist,
        sensor_count: 3,
        outlet: 0,
        outlet_count: 1,
        parent: number.checked_sub(1).map(u16::from),
        uid: PartUid([number; 12]),
        counts_per_turn: 65_536,
    }
}
