//! Bytes waiting to be sent.

/// A bounded queue that sends at a line's speed. When it is full, whole frames are dropped, newest first, as by a
/// device whose buffer is full.
#[derive(Debug)]
pub(super) struct Queue {
    bytes: Vec<u8>,
    /// Bytes at the front that have already been sent.
    gone: usize,
    limit: usize,
    bytes_per_second: Option<u64>,
    /// Millionths of a byte that may be sent, and the time up to which this is accounted.
    credit: u64,
    credited_micros: u64,
    bytes_sent: u64,
    frames_dropped: u64,
    bytes_dropped: u64,
}

/// A paced line that was idle may send this much time's worth in one burst, microseconds.
const BURST_MICROS: u64 = 2_000;

impl Queue {
    pub(super) fn new(limit: usize, baud: Option<u32>) -> Self {
        Self {
            bytes: Vec::new(),
            gone: 0,
            limit,
            bytes_per_second: baud.map(|baud| u64::from(baud / 10).max(1)),
            credit: 0,
            credited_micros: 0,
            bytes_sent: 0,
            frames_dropped: 0,
            bytes_dropped: 0,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.gone == self.bytes.len()
    }

    /// Adds as many frames as fit.
    pub(super) fn push(&mut self, frames: &[u8]) {
        let room = self.limit.saturating_sub(self.bytes.len() - self.gone);
        let fits = if frames.len() <= room {
            frames.len()
        } else {
            frames[..room].iter().rposition(|&byte| byte == 0).map_or(0, |delimiter| delimiter + 1)
        };
        let (kept, dropped) = frames.split_at(fits);
        self.bytes.extend_from_slice(kept);
        self.count_dropped(dropped.len(), dropped);
    }

    /// What may be sent now.
    pub(super) fn sendable(&mut self, now_micros: u64) -> &[u8] {
        let waiting = &self.bytes[self.gone..];
        let Some(speed) = self.bytes_per_second else { return waiting };
        let elapsed = now_micros.saturating_sub(self.credited_micros);
        self.credited_micros = now_micros.max(self.credited_micros);
        let most = (speed * BURST_MICROS).max(1_000_000);
        self.credit = self.credit.saturating_add(elapsed.saturating_mul(speed)).min(most);
        &waiting[..waiting.len().min((self.credit / 1_000_000) as usize)]
    }

    /// Records that `count` bytes went out.
    pub(super) fn sent(&mut self, count: usize) {
        self.gone = (self.gone + count).min(self.bytes.len());
        self.bytes_sent += count as u64;
        self.credit = self.credit.saturating_sub(count as u64 * 1_000_000);
        if self.gone == self.bytes.len() {
            self.bytes.clear();
            self.gone = 0;
        } else if self.gone > self.limit {
            self.bytes.drain(..self.gone);
            self.gone = 0;
        }
    }

    /// Drops everything because nobody is connected.
    pub(super) fn discard(&mut self) {
        let bytes = std::mem::take(&mut self.bytes);
        self.count_dropped(bytes.len() - self.gone, &bytes[self.gone..]);
        self.gone = 0;
    }

    /// Bytes sent, frames dropped, bytes dropped.
    pub(super) fn totals(&self) -> (u64, u64, u64) {
        (self.bytes_sent, self.frames_dropped, self.bytes_dropped)
    }

    fn count_dropped(&mut self, count: usize, bytes: &[u8]) {
        self.bytes_dropped += count as u64;
        // Every frame ends with the delimiter, which occurs nowhere else.
        self.frames_dropped += bytes.split(|&byte| byte == 0).count().saturating_sub(1) as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_dropped_in_whole_frames() {
        let mut queue = Queue::new(10, None);
        queue.push(&[1, 1, 0, 2, 2, 0]);
        queue.push(&[3, 0, 4, 4, 0, 5, 0]);
        assert_eq!(queue.sendable(0), [1, 1, 0, 2, 2, 0, 3, 0]);
        assert_eq!(queue.totals(), (0, 2, 5));
        queue.sent(5);
        queue.push(&[6, 0]);
        assert_eq!(queue.sendable(0), [0, 3, 0, 6, 0]);
        queue.discard();
        assert!(queue.is_empty());
        assert_eq!(queue.totals(), (5, 5, 10));
    }

    #[test]
    fn a_paced_line_keeps_its_speed() {
        let mut queue = Queue::new(1 << 20, Some(1_000_000));
        queue.push(&vec![7; 200_000]);
        let mut total = 0;
        for millis in 0..1000 {
            let count = queue.sendable(millis * 1000).len();
            assert!(count <= 200, "no burst");
            queue.sent(count);
            total += count;
        }
        assert_eq!(total, 99_900, "100 kB/s over 999 ms");
        assert!(queue.sendable(100_000_000).len() <= 200, "idle time is not saved up");
    }
}
