//! A virtual clock with access to the wire.

use std::cell::Cell;
use std::rc::Rc;

use armature::engine::sources::VirtualSource;
use armature_sim::Puppet;

/// May damage a frame (its number, its bytes without the delimiter); returns whether it did.
pub(crate) type Damage = fn(usize, &mut [u8]) -> bool;

/// How many frames were damaged, and how long they are with their delimiters.
pub(crate) type Damaged = Rc<Cell<(u64, u64)>>;

/// A puppet heard through damaged frames.
pub(crate) fn tapped(puppet: Puppet, samples_per_second: f64, damage: Damage) -> (VirtualSource, Damaged) {
    let damaged = Damaged::default();
    let count = damaged.clone();
    let mut frames = 0;
    let source = VirtualSource::through(puppet, samples_per_second, move |bytes| {
        // The simulator puts whole frames on the line.
        for frame in bytes.split_mut(|byte| *byte == 0).filter(|frame| !frame.is_empty()) {
            if damage(frames, frame) {
                let (frames, bytes) = count.get();
                count.set((frames + 1, bytes + frame.len() as u64 + 1));
            }
            frames += 1;
        }
    });
    (source, damaged)
}
