//! Frames survive what a wire does to them, and the telemetry fits the wire.

use muslip_record::*;
use proptest::prelude::*;

fn envelope<T>(body: T) -> Envelope<T> {
    Envelope {
        sequence: u16::MAX,
        body,
    }
}

const WORST_ESTIMATING: Estimating = Estimating {
    estimator: Estimator::Article,
    compensated: u8::MAX,
};

fn worst_sample() -> Telemetry {
    Telemetry::Sample(Sample {
        tick: u32::MAX,
        wheel_speed_rad_s: f32::NAN,
        vehicle_speed_m_s: 1.0,
        drag_force_n: 1.0,
        normal_force_n: 1.0,
        brake_demand: 1.0,
        state: State::Fault,
    })
}

fn worst_estimate() -> Telemetry {
    Telemetry::Estimate(Estimate {
        tick: u32::MAX,
        slip_ratio: 0.1,
        friction: 0.1,
        peak_friction: 0.1,
        critical_slip: 0.1,
        p00: 0.1,
        p01: 0.1,
        p11: 0.1,
        updates: u32::MAX,
        estimating: WORST_ESTIMATING,
    })
}

fn length<T: serde::Serialize>(message: &T) -> usize {
    let mut buffer = [0; FRAME_BYTES];
    encode(message, &mut buffer).map_or(usize::MAX, <[u8]>::len)
}

#[test]
fn samples_and_estimates_leave_a_fifth_of_the_wire_free() {
    let quarter_car = Telemetry::QuarterCar(QuarterCar {
        tick: u32::MAX,
        state: [0.1; 5],
        covariance: [0.1; 15],
        rejected: [u16::MAX; 4],
    });
    let sample = length(&envelope(worst_sample()));
    let estimate = length(&envelope(worst_estimate())) + length(&envelope(quarter_car));
    let a_second =
        sample as u32 * SAMPLE_RATE_HZ + estimate as u32 * SAMPLE_RATE_HZ / SAMPLES_PER_ESTIMATE;
    println!(
        "sample {sample} bytes, both estimates {estimate} bytes: {a_second} of {LINK_BYTES_PER_SECOND} bytes a second, {:.1} %",
        100.0 * f64::from(a_second) / f64::from(LINK_BYTES_PER_SECOND)
    );
    assert!(sample < FRAME_BYTES && estimate < 2 * FRAME_BYTES);
    assert!(a_second * 5 <= LINK_BYTES_PER_SECOND * 4);
}

#[test]
fn the_longest_messages_fit_a_frame() {
    let all = u32::MAX;
    let status = Telemetry::Status(Status {
        tick: all,
        state: State::Fault,
        fault: Some(Fault::Timeout),
        standing: all,
        link: LinkCounters {
            received: all,
            corrupt: all,
            oversized: all,
            foreign: all,
            duplicate: all,
            lost: all,
            overrun_bytes: all,
            dropped: all,
        },
        worst_interrupt_cycles: all,
        worst_link_interrupt_cycles: all,
        worst_step_cycles: all,
        stack_used_bytes: all,
        brake_energy_j: all,
        parameters: Origin::Previous,
        estimating: WORST_ESTIMATING,
        reset_flags: u8::MAX,
        end: Some(PostMortem {
            end: End::Stack,
            program_counter: all,
            link_register: all,
            fault_status: all,
            hard_fault_status: all,
            address: all,
            state: State::Fault,
            tick: all,
        }),
    });
    let mut parameters = Parameters::default();
    parameters.drag.zero_code = i32::MIN;
    parameters.normal.zero_code = i32::MIN;
    parameters.wheel_encoder.pulses_per_revolution = u16::MAX;
    parameters.vehicle_encoder.pulses_per_revolution = u16::MAX;
    parameters.compensation = CompensationParameters {
        effective_radius: Some(RadiusCompensation::WithSpeed {
            relative_error: 0.1,
            per_relative_speed_squared: 0.1,
            mean_vehicle_speed_m_s: 20.0,
        }),
        force_delay_s: Some(0.01),
        force_lag_s: Some(0.01),
        load_crosstalk: Some(0.01),
        load_sensitivity: Some(LoadCompensation {
            sensitivity: 0.1,
            critical_slip_exponent: 0.1,
            mean_normal_force_n: 4000.0,
        }),
        speed_sensitivity: Some(SpeedCompensation::SlidingWithFloor {
            floor: 0.8,
            speed_scale_m_s: 5.0,
        }),
        relaxation: Some(RelaxationCompensation::Force { length_m: 0.3 }),
        thermal_fade: Some(ThermalCompensation {
            sensitivity_per_s: 0.1,
            curvature_per_s2: 0.1,
            time_constant_s: 5.0,
            reference_power_w: 1e4,
        }),
    };
    let profile = Profile {
        program: Program::Steps {
            levels: [1.0; STEPS],
            count: u8::MAX,
            hold_s: 1.0,
        },
        start_speed_m_s: 1.0,
        skid_slip: 1.0,
        skid_hold_s: 1.0,
        applications: u8::MAX,
        cool_s: 1.0,
    };
    for length in [
        length(&envelope(status)),
        length(&envelope(Telemetry::Parameters(parameters))),
        length(&envelope(Command::SetParameters { parameters })),
        length(&envelope(Command::Start { profile })),
    ] {
        assert!(length <= FRAME_BYTES, "{length}");
    }
}

/// Feeds bytes and collects what comes out.
fn read(bytes: &[u8]) -> Vec<Result<Envelope<Telemetry>, FrameError>> {
    let mut reader = FrameReader::new();
    bytes.iter().filter_map(|&byte| reader.push(byte)).collect()
}

#[test]
fn a_frame_is_stuffed_and_checked_as_published() {
    // CRC-32/ISO-HDLC of these nine digits is 0xCBF43926, the catalogue's check value. No zero in it: COBS puts the
    // distance to the closing one in front.
    let mut buffer = [0; FRAME_BYTES];
    let frame = encode(b"123456789", &mut buffer).unwrap();
    assert_eq!(frame, b"\x0e123456789\x26\x39\xf4\xcb\x00");
}

#[test]
fn an_oversized_frame_is_reported_once_and_the_next_is_read() {
    let mut bytes = vec![7; 5 * FRAME_BYTES];
    bytes.push(0);
    let mut buffer = [0; FRAME_BYTES];
    bytes.extend_from_slice(encode(&envelope(worst_estimate()), &mut buffer).unwrap());
    assert_eq!(
        read(&bytes),
        [Err(FrameError::Oversized), Ok(envelope(worst_estimate()))]
    );
}

#[test]
fn a_whole_frame_of_another_type_is_foreign() {
    let mut buffer = [0; FRAME_BYTES];
    let frame = encode(&[0xA5_u8; 30], &mut buffer).unwrap();
    assert_eq!(read(frame), [Err(FrameError::Foreign)]);
    // A message with something behind it is none of ours either.
    let frame = encode(&(envelope(Command::Arm), 1_u8), &mut buffer).unwrap();
    let mut reader = FrameReader::new();
    let results: Vec<_> = frame
        .iter()
        .filter_map(|&byte| reader.push::<Envelope<Command>>(byte))
        .collect();
    assert_eq!(results, [Err(FrameError::Foreign)]);
}

#[test]
fn a_message_too_long_is_refused() {
    let mut buffer = [0; FRAME_BYTES];
    assert_eq!(
        encode(&([1_u64; 30], [u64::MAX; 30]), &mut buffer),
        Err(EncodeError)
    );
}

proptest! {
    #[test]
    fn stuffing_is_that_of_an_independent_implementation(body in prop::collection::vec(prop_oneof![Just(0_u8), any::<u8>()], 0..200)) {
        let mut buffer = [0; FRAME_BYTES];
        let frame = encode(&body.as_slice(), &mut buffer).unwrap();
        prop_assert_eq!(frame.last(), Some(&0));
        prop_assert!(!frame[..frame.len() - 1].contains(&0));
        let mut decoded = vec![0; frame.len()];
        let length = cobs::decode(&frame[..frame.len() - 1], &mut decoded).unwrap().frame_size();
        // One byte of length (two from 128 on), the body, the checksum.
        let prefix = if body.len() < 128 { 1 } else { 2 };
        prop_assert_eq!(&decoded[prefix..length - 4], body.as_slice());
        // The CRC of message and checksum is the residue that IEEE 802.3 names.
        let residue = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&decoded[..length]);
        prop_assert_eq!(residue, 0x2144_DF1C);
    }

    #[test]
    fn one_changed_byte_never_passes(at in 0_usize..30, change in 1_u8..=255) {
        let mut buffer = [0; FRAME_BYTES];
        let mut bytes = encode(&envelope(worst_sample()), &mut buffer).unwrap().to_vec();
        let at = at % bytes.len();
        bytes[at] ^= change;
        bytes.push(0);
        let results = read(&bytes);
        prop_assert!(results.iter().all(Result::is_err), "{:?}", results);
    }

    #[test]
    fn any_bytes_are_survived_and_the_frame_after_a_zero_is_read(noise in prop::collection::vec(any::<u8>(), 0..600)) {
        let mut bytes = noise;
        bytes.push(0);
        let mut buffer = [0; FRAME_BYTES];
        bytes.extend_from_slice(encode(&envelope(worst_estimate()), &mut buffer).unwrap());
        let results = read(&bytes);
        prop_assert_eq!(results.last(), Some(&Ok(envelope(worst_estimate()))));
    }
}

#[test]
fn every_body_of_up_to_two_bytes_survives_its_frame() {
    let mut buffer = [0; FRAME_BYTES];
    for first in 0..=255_u8 {
        let frame = encode(&[first], &mut buffer).unwrap().to_vec();
        let mut reader = FrameReader::new();
        let back: Vec<_> = frame
            .iter()
            .filter_map(|&b| reader.push::<[u8; 1]>(b))
            .collect();
        assert_eq!(back, [Ok([first])]);
        for second in 0..=255 {
            let body = [first, second];
            let frame = encode(&body, &mut buffer).unwrap();
            assert_eq!(
                frame.iter().position(|&byte| byte == 0),
                Some(frame.len() - 1)
            );
            let mut reader = FrameReader::new();
            let back: Vec<_> = frame
                .iter()
                .filter_map(|&b| reader.push::<[u8; 2]>(b))
                .collect();
            assert_eq!(back, [Ok(body)]);
        }
    }
}

#[test]
fn every_byte_of_a_frame_changed_to_every_other_and_every_cut_of_it_is_seen() {
    let mut buffer = [0; FRAME_BYTES];
    let whole = encode(&envelope(worst_sample()), &mut buffer)
        .unwrap()
        .to_vec();
    let last = whole.len() - 1;
    for at in 0..last {
        for value in (0..=255).filter(|&value| value != whole[at]) {
            let mut bytes = whole.clone();
            bytes[at] = value;
            let results = read(&bytes);
            assert!(
                results.iter().all(Result::is_err),
                "{at} {value}: {results:?}"
            );
        }
        let cut = [&whole[..at], &[0]].concat();
        assert!(read(&cut).iter().all(Result::is_err), "{at}");
        let begun_late = &whole[at + 1..];
        assert!(read(begun_late).iter().all(Result::is_err), "{at}");
    }
}

#[test]
fn after_every_short_stream_of_bytes_that_matter_the_next_frame_is_read() {
    // What ends a frame, what points one, two and as far ahead as COBS goes, and a plain byte.
    const BYTES: [u8; 5] = [0, 1, 2, 0xFF, 7];
    let mut buffer = [0; FRAME_BYTES];
    let frame = encode(&envelope(worst_estimate()), &mut buffer)
        .unwrap()
        .to_vec();
    let mut streams = 0;
    for length in 0..=7 {
        for stream in 0..BYTES.len().pow(length) {
            let mut bytes: Vec<u8> = (0..length)
                .map(|at| BYTES[stream / BYTES.len().pow(at) % BYTES.len()])
                .collect();
            bytes.push(0);
            let ended = bytes.iter().filter(|&&byte| byte == 0).count();
            bytes.extend_from_slice(&frame);
            let results = read(&bytes);
            assert_eq!(results.last(), Some(&Ok(envelope(worst_estimate()))));
            assert!(results.len() <= ended + 1);
            assert!(results[..results.len() - 1].iter().all(Result::is_err));
            streams += 1;
        }
    }
    assert_eq!(streams, 97_656);
}
