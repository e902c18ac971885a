//! Both encoders: TIM3 and TIM4 count in quadrature, TIM5 and TIM2 stamp channel A's rising edges.

use muslip_control::board::EncoderReading;
use muslip_control::encoder::rising_edges;

use crate::bits::low_u16;
use crate::registers::{ALL_16, Registers, Setting, set, set_up};

/// How often a reading is tried again when an edge comes in its middle: a second edge within it is rare.
const TRIES: u32 = 4;

const TIM2: u32 = 0x4000_0000;
const TIM3: u32 = 0x4000_0400;
const TIM4: u32 = 0x4000_0800;
const TIM5: u32 = 0x4000_0C00;
const CR1: u32 = 0x00;
const EGR: u32 = 0x14;
const CNT: u32 = 0x24;
const CCR1: u32 = 0x34;

/// The counter of each encoder, and the timer that stamps: wheel, vehicle.
const TIMERS: [(u32, u32); 2] = [(TIM3, TIM5), (TIM4, TIM2)];

/// Input filter of counters and captures alike: eight equal samples at the timer's clock (18.4.7: IC1F).
const FILTER: u32 = 0b0011;
const CAPTURE_1: u32 = 1 | FILTER << 4;
const CAPTURE_1_AND_2: u32 = CAPTURE_1 | 1 << 8 | FILTER << 12;

/// Encoder counters and the timers that stamp, all but the counters' start: their count is preset before.
pub const ENCODERS: [Setting; 16] = [
    // Encoder mode on TI1's edges, direction by TI2's level (18.4.3: SMS = 010).
    set("TIM3_CCMR1", TIM3 + 0x18, ALL_16, CAPTURE_1_AND_2),
    set("TIM3_SMCR", TIM3 + 0x08, ALL_16, 0b010),
    set("TIM3_ARR", TIM3 + 0x2C, ALL_16, ALL_16),
    set("TIM4_CCMR1", TIM4 + 0x18, ALL_16, CAPTURE_1_AND_2),
    set("TIM4_SMCR", TIM4 + 0x08, ALL_16, 0b010),
    set("TIM4_ARR", TIM4 + 0x2C, ALL_16, ALL_16),
    // Free-running over 32 bits, capture of TI1's rising edge (18.4.7, 18.4.9).
    set("TIM5_PSC", TIM5 + 0x28, ALL_16, 0),
    set("TIM5_ARR", TIM5 + 0x2C, u32::MAX, u32::MAX),
    set("TIM5_CCMR1", TIM5 + 0x18, ALL_16, CAPTURE_1),
    set("TIM5_CCER", TIM5 + 0x20, ALL_16, 1),
    set("TIM5_CR1", TIM5, ALL_16, 1),
    set("TIM2_PSC", TIM2 + 0x28, ALL_16, 0),
    set("TIM2_ARR", TIM2 + 0x2C, u32::MAX, u32::MAX),
    set("TIM2_CCMR1", TIM2 + 0x18, ALL_16, CAPTURE_1),
    set("TIM2_CCER", TIM2 + 0x20, ALL_16, 1),
    set("TIM2_CR1", TIM2, ALL_16, 1),
];

/// The counters' start; bit 4 of CR1 is their direction, which moves.
pub const COUNTERS_ON: [Setting; 2] = [
    set("TIM3_CR1", TIM3, ALL_16 & !(1 << 4), 1),
    set("TIM4_CR1", TIM4, ALL_16 & !(1 << 4), 1),
];

/// Both encoders.
pub struct Encoders<B>(B);

impl<B: Registers> Encoders<B> {
    /// Starts all four timers, whose clocks run; `levels` are those of channel A now, wheel and vehicle.
    pub fn start(mut bus: B, levels: [bool; 2]) -> Self {
        set_up(&ENCODERS, &mut bus);
        for ((counter, stamp), high) in TIMERS.into_iter().zip(levels) {
            bus.write(stamp + EGR, 1);
            // Odd while A is high, from the start: see `rising_edges`.
            bus.write(counter + CNT, u32::from(high));
        }
        set_up(&COUNTERS_ON, &mut bus);
        Self(bus)
    }

    /// Both encoders on timers as they are.
    pub fn untouched(bus: B) -> Self {
        Self(bus)
    }

    /// Wheel and vehicle.
    pub fn read(&mut self) -> [EncoderReading; 2] {
        TIMERS.map(|(counter, stamp)| {
            let bus = &mut self.0;
            let mut reading = EncoderReading::default();
            for _ in 0..TRIES {
                let count = low_u16(bus.read(counter + CNT));
                // DIR is bit 4 of CR1 and set while counting down.
                let down = bus.read(counter + CR1) & 1 << 4 != 0;
                let edge_ticks = bus.read(stamp + CCR1);
                let now_ticks = bus.read(stamp + CNT);
                reading = EncoderReading {
                    edges: rising_edges(count, down),
                    edge_ticks,
                    age_ticks: now_ticks.wrapping_sub(edge_ticks),
                };
                if low_u16(bus.read(counter + CNT)) == count {
                    break;
                }
            }
            reading
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Timers of which an edge comes after so many reads.
    struct Timers {
        reads: u32,
        edge_at: u32,
    }

    impl Registers for Timers {
        fn read(&mut self, address: u32) -> u32 {
            self.reads += 1;
            let after = self.reads > self.edge_at;
            match address {
                // Odd: A is high.
                a if a == TIM3 + CNT => 0x1_0001 + 2 * u32::from(after),
                a if a == TIM5 + CCR1 => 1_000 + 500 * u32::from(after),
                a if a == TIM5 + CNT => 2_000,
                _ => 0,
            }
        }

        fn write(&mut self, _: u32, _: u32) {}
    }

    #[test]
    fn count_and_stamp_are_of_the_same_edge_whenever_one_comes() {
        for edge_at in 0..12 {
            let timers = Timers { reads: 0, edge_at };
            let [wheel, _] = Encoders::untouched(timers).read();
            let before = (1, 1_000, 1_000);
            let after = (3, 1_500, 500);
            let read = (wheel.edges, wheel.edge_ticks, wheel.age_ticks);
            assert!(read == before || read == after, "{edge_at}: {read:?}");
        }
    }
}
