use proptest::prelude::*;

use super::*;

fn all(bytes: &[u8]) -> Vec<Status> {
    let mut decoder = Decoder::default();
    decoder.receive(bytes);
    std::iter::from_fn(|| decoder.next_status()).collect()
}

fn hexadecimal(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

/// A fast answer as the servos write it, each behind the other.
fn fast_answer(servos: &[(u8, [u8; 4])]) -> Vec<u8> {
    let mut packet = hexadecimal("FF FF FD 00 FE");
    packet.extend(((servos.len() * 8 + 1) as u16).to_le_bytes());
    packet.push(0x55);
    for (id, data) in servos {
        packet.extend([0, *id]);
        packet.extend(data);
        let crc = checksum(&packet);
        packet.extend(crc.to_le_bytes());
    }
    packet
}

#[test]
fn requests_are_the_published_bytes() {
    assert_eq!(checksum(b"123456789"), 0xFEE8);
    assert_eq!(ping(BROADCAST), hexadecimal("FF FF FD 00 FE 03 00 01 31 42"));
    assert_eq!(read(1, 132, 4), hexadecimal("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"));
    assert_eq!(sync_read(&[1, 2], 132, 4), hexadecimal("FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"));
    assert_eq!(fast_sync_read(&[1, 2], 132, 4), hexadecimal("FF FF FD 00 FE 09 00 8A 84 00 04 00 01 02 4D 72"));
}

#[test]
fn statuses_are_read_and_unstuffed() {
    let position = all(&hexadecimal("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"));
    assert_eq!(position[0].double_word(), Some(166));
    let stuffed = hexadecimal("FF FF FD 00 01 0F 00 55 00 FF FF FD FD FF FF FF 00 08 00 00 49 F0");
    let status = all(&stuffed);
    assert_eq!(status[0].data, hexadecimal("FF FF FD FF FF FF 00 08 00 00"), "current -1, velocity -3, position 2048");
    let again = request(1, 0x55, &[&[0], &status[0].data[..]].concat());
    assert_eq!(again, stuffed, "written again it is the same");
}

#[test]
fn a_fast_answer_comes_apart_and_one_that_breaks_off_is_kept_up_to_there() {
    let servos = [(1, [1, 0, 0, 0]), (2, [0xFF, 0xFF, 0xFD, 0xFF]), (7, [7, 7, 0, 0])];
    let answer = fast_answer(&servos);
    let heard = |bytes: &[u8]| {
        let mut decoder = Decoder::default();
        decoder.expect_fast(3, 4);
        decoder.receive(bytes);
        let mut found: Vec<(u8, Vec<u8>)> = Vec::new();
        loop {
            found.extend(std::iter::from_fn(|| decoder.next_status()).map(|status| (status.id, status.data)));
            if !decoder.give_up_waiting() {
                return found;
            }
        }
    };
    let truth: Vec<(u8, Vec<u8>)> = servos.iter().map(|(id, data)| (*id, data.to_vec())).collect();
    assert_eq!(heard(&answer), truth);
    assert_eq!(heard(&answer[..answer.len() - 3]), truth[..2]);
    let mut damaged = answer.clone();
    damaged[18] ^= 0x10;
    assert_eq!(heard(&damaged), truth[..1], "what comes behind the damage cannot be trusted");
    let echoed = [fast_sync_read(&[1, 2, 7], 132, 4), answer].concat();
    assert_eq!(heard(&echoed), truth, "an echo is no answer");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn packets_come_back_as_they_went(
        id in 0_u8..0xFD, data in prop::collection::vec(prop_oneof![Just(0xFF_u8), Just(0xFD_u8), any::<u8>()], 0..40),
        garbage in prop::collection::vec(0_u8..0xFF, 0..40),
    ) {
        let packet = request(id, STATUS, &[&[3], &data[..]].concat());
        prop_assert!(packet[FRONT..].windows(4).all(|four| four != HEADER), "no header inside");
        let found = all(&[garbage, packet].concat());
        prop_assert_eq!(found, vec![Status { id, error: 3, data }]);
    }

    #[test]
    fn any_bytes_are_survived(
        bytes in prop::collection::vec(prop_oneof![Just(0xFF_u8), Just(0xFD_u8), Just(0_u8), 0_u8..9, any::<u8>()], 0..500),
        fast in any::<bool>(), cut in 0_usize..500,
    ) {
        let mut decoder = Decoder::default();
        if fast { decoder.expect_fast(3, 4) } else { decoder.expect(4) }
        let (front, rear) = bytes.split_at(cut.min(bytes.len()));
        for piece in [front, rear] {
            decoder.receive(piece);
            while decoder.next_status().is_some() {}
        }
        while decoder.give_up_waiting() {
            while decoder.next_status().is_some() {}
        }
        prop_assert!(decoder.next_status().is_none());
        prop_assert!(decoder.counters().discarded_bytes <= bytes.len() as u64);
    }
}
