//! Commands and telemetry on a wire that repeats, loses, damages and fills up.

use muslip_record::{Answer, Command, FRAME_BYTES, State, Telemetry, encode};

use crate::bench::{Bench, RAMP};

#[test]
fn a_repeated_command_is_answered_again_and_done_once() {
    let mut bench = Bench::new();
    bench.run(50);
    let frame = bench.frame(Command::Arm);
    bench.sample(&frame);
    assert_eq!(bench.state(), State::Armed);
    bench.heard.clear();
    bench.sample(&frame);
    // Done once more it would have been refused: it is armed already.
    let number = bench.number;
    assert!(bench.heard.contains(&Telemetry::Answer {
        command: number,
        answer: Answer::Done
    }));
    bench.number += 3;
    let link = bench.status().link;
    assert_eq!((link.duplicate, link.lost), (1, 3));
}

#[test]
fn oversized_foreign_and_corrupt_frames_are_counted_apart_and_the_next_is_obeyed() {
    let mut bench = Bench::new();
    bench.run(50);
    let before = bench.status().link;
    // Longer than any frame, in pieces as a wire brings them.
    for piece in [1_u8; 300].chunks(92) {
        bench.sample(piece);
    }
    bench.sample(&[0]);
    // Whole, but no command.
    let mut buffer = [0; FRAME_BYTES];
    let foreign = encode(&[0xFF_u8; 20], &mut buffer).unwrap().to_vec();
    bench.sample(&foreign);
    let mut corrupt = bench.frame(Command::Arm);
    // Another byte, and no zero, which would make two frames of it.
    corrupt[3] = corrupt[3] % 255 + 1;
    bench.sample(&corrupt);
    assert_eq!(bench.state(), State::Idle);
    assert_eq!(bench.say(Command::Arm), Answer::Done);
    let link = bench.status().link;
    assert_eq!(
        (
            link.oversized - before.oversized,
            link.foreign - before.foreign,
            link.corrupt - before.corrupt
        ),
        (1, 1, 1)
    );
}

#[test]
fn a_wire_without_room_drops_telemetry_and_counts_it_and_control_goes_on() {
    let mut bench = Bench::braking();
    let before = bench.status().link.dropped;
    bench.room = 0;
    let duty = bench.output.valve_duty;
    let mut keep_alive = 0;
    for _ in 0..200 {
        keep_alive += 1;
        if keep_alive % 100 == 0 {
            let bytes = bench.frame(Command::KeepAlive);
            bench.sample(&bytes);
        } else {
            bench.sample(&[]);
        }
    }
    assert!(bench.output.valve_duty > duty);
    bench.room = 4096;
    let dropped = bench.status().link.dropped - before;
    // A sample each but for the first, which waits, and an estimate every tenth; both answers wait behind it.
    assert_eq!(dropped, 200 - 1 + 20);
    let number = bench.number;
    for answered in [number - 2, number - 1] {
        assert!(bench.heard.iter().any(|message| matches!(
            message,
            Telemetry::Answer { command, answer: Answer::Done } if *command == answered
        )));
    }
}

#[test]
fn one_byte_in_ten_corrupted_is_counted_and_does_not_disturb_a_run() {
    let mut bench = Bench::new();
    bench.keep_alive = false;
    bench.start(RAMP);
    let mut random = 1_u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random >> 8
    };
    for index in 0..400 {
        let mut bytes = Vec::new();
        if index % 20 == 0 {
            bytes = bench.frame(Command::KeepAlive);
        } else if index % 3 == 0 {
            bytes = bench.frame(Command::ReadStatus);
        }
        for byte in &mut bytes {
            if next() % 10 == 0 {
                *byte ^= (next() % 255) as u8 + 1;
            }
        }
        bench.sample(&bytes);
    }
    assert_eq!(bench.state(), State::Ramp, "{:?}", bench.controller.fault());
    // A frame that lost its closing zero would swallow the next.
    bench.sample(&[0]);
    let link = bench.status().link;
    assert!(
        link.corrupt > 30 && link.lost > 30 && link.received > 30,
        "{link:?}"
    );
}
