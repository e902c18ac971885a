//! A short recording framed as the controller sends it, and read back from a wire that damages it.
//!
//! `cargo run -p muslip-record --example frames`.

use muslip_record::{
    EncodeError, Envelope, FRAME_BYTES, FrameReader, SAMPLE_RATE_HZ, Sample, State, Telemetry,
    encode,
};

/// What the controller reads on one tick.
fn sampled(tick: u32) -> Sample {
    Sample {
        tick,
        wheel_speed_rad_s: 64.5 - 0.01 * tick as f32,
        vehicle_speed_m_s: 20.0,
        drag_force_n: 4.0 * tick as f32,
        normal_force_n: 4000.0,
        brake_demand: 0.001 * tick as f32,
        state: State::Ramp,
    }
}

/// The sender: each sample in an envelope that numbers it, each envelope in a frame.
fn framed(samples: u32) -> Result<Vec<u8>, EncodeError> {
    let mut wire = Vec::new();
    let mut buffer = [0; FRAME_BYTES];
    for tick in 0..samples {
        let envelope = Envelope {
            // Counts around: a receiver looks at differences only.
            sequence: tick as u16,
            body: Telemetry::Sample(sampled(tick)),
        };
        wire.extend_from_slice(encode(&envelope, &mut buffer)?);
    }
    Ok(wire)
}

fn main() -> Result<(), EncodeError> {
    let mut wire = framed(SAMPLE_RATE_HZ / 10)?;
    println!("100 samples are {} bytes", wire.len());
    // A bit flips on the way, and a few bytes are lost.
    if let Some(byte) = wire.get_mut(700) {
        *byte ^= 0x10;
    }
    wire.drain(2000..2010);

    // The receiver: bytes in as they come, messages out; what is damaged costs its frame and no other.
    let mut reader = FrameReader::new();
    let (mut received, mut damaged, mut missing) = (0, 0, 0_u16);
    let mut expected = 0_u16;
    for byte in wire {
        match reader.push::<Envelope<Telemetry>>(byte) {
            None => {}
            Some(Err(error)) => {
                println!("after {received} samples: {error}");
                damaged += 1;
            }
            Some(Ok(envelope)) => {
                missing += envelope.sequence.wrapping_sub(expected);
                expected = envelope.sequence.wrapping_add(1);
                if let Telemetry::Sample(sample) = envelope.body {
                    assert_eq!(sample, sampled(sample.tick));
                    received += 1;
                }
            }
        }
    }
    println!("{received} samples received, {damaged} frames damaged, {missing} samples missing");
    Ok(())
}
