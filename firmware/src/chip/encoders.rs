//! Both encoders: TIM3 and TIM4 count in quadrature, TIM5 and TIM2 stamp channel A's rising edges.

use muslip_control::board::EncoderReading;
use muslip_control::encoder::rising_edges;
use stm32f4::stm32f405::{RCC, TIM2, TIM3, TIM4, TIM5};

/// Input filter of counters and captures alike: eight equal samples at the timer's clock (18.4.7: IC1F).
const FILTER: u32 = 0b0011;
/// How often a reading is tried again when an edge comes in its middle: a second edge within it is rare.
const TRIES: u32 = 4;

/// Both encoders.
pub struct Encoders {
    wheel: TIM3,
    vehicle: TIM4,
    wheel_stamp: TIM5,
    vehicle_stamp: TIM2,
}

macro_rules! start_counter {
    ($timer:expr, $a_is_high:expr) => {{
        // Encoder mode on TI1's edges, direction by TI2's level (18.4.3: SMS = 010).
        $timer
            .ccmr1_input()
            .write(|w| unsafe { w.bits((1 | FILTER << 4 | 1 << 8 | FILTER << 12) as _) });
        $timer.smcr().write(|w| unsafe { w.bits(0b010) });
        $timer.arr().write(|w| unsafe { w.bits(0xFFFF) });
        // Odd while A is high, from the start: see `rising_edges`.
        $timer
            .cnt()
            .write(|w| unsafe { w.bits(u32::from($a_is_high) as _) });
        $timer.cr1().write(|w| unsafe { w.bits(1) });
    }};
}

macro_rules! start_stamp {
    ($timer:expr) => {{
        // Free-running over 32 bits, capture of TI1's rising edge (18.4.7, 18.4.9).
        $timer.psc().write(|w| unsafe { w.bits(0) });
        $timer.arr().write(|w| unsafe { w.bits(u32::MAX as _) });
        $timer
            .ccmr1_input()
            .write(|w| unsafe { w.bits((1 | FILTER << 4) as _) });
        $timer.ccer().write(|w| unsafe { w.bits(1) });
        $timer.egr().write(|w| unsafe { w.bits(1) });
        $timer.cr1().write(|w| unsafe { w.bits(1) });
    }};
}

macro_rules! read {
    ($counter:expr, $stamp:expr) => {{
        let mut reading = EncoderReading::default();
        for _ in 0..TRIES {
            let count = $counter.cnt().read().bits() as u16;
            // DIR is bit 4 of CR1 and set while counting down.
            let down = $counter.cr1().read().bits() & 1 << 4 != 0;
            let edge_ticks = $stamp.ccr1().read().bits() as u32;
            let now_ticks = $stamp.cnt().read().bits() as u32;
            reading = EncoderReading {
                edges: rising_edges(count, down),
                edge_ticks,
                age_ticks: now_ticks.wrapping_sub(edge_ticks),
            };
            if $counter.cnt().read().bits() as u16 == count {
                break;
            }
        }
        reading
    }};
}

impl Encoders {
    /// Starts all four timers; pins are set up already.
    pub fn start(
        rcc: &RCC,
        wheel: TIM3,
        vehicle: TIM4,
        wheel_stamp: TIM5,
        vehicle_stamp: TIM2,
    ) -> Self {
        rcc.apb1enr()
            .modify(|r, w| unsafe { w.bits(r.bits() | 0b1111) });
        // SAFETY: reading levels has no effect.
        let (wheel_high, vehicle_high) = unsafe {
            (
                (*stm32f4::stm32f405::GPIOC::ptr()).idr().read().bits() & 1 << 6 != 0,
                (*stm32f4::stm32f405::GPIOB::ptr()).idr().read().bits() & 1 << 6 != 0,
            )
        };
        start_counter!(wheel, wheel_high);
        start_counter!(vehicle, vehicle_high);
        start_stamp!(wheel_stamp);
        start_stamp!(vehicle_stamp);
        Self::untouched(wheel, vehicle, wheel_stamp, vehicle_stamp)
    }

    /// Both encoders on timers as they are.
    pub fn untouched(wheel: TIM3, vehicle: TIM4, wheel_stamp: TIM5, vehicle_stamp: TIM2) -> Self {
        Self {
            wheel,
            vehicle,
            wheel_stamp,
            vehicle_stamp,
        }
    }

    /// Wheel and vehicle.
    pub fn read(&mut self) -> [EncoderReading; 2] {
        [
            read!(self.wheel, self.wheel_stamp),
            read!(self.vehicle, self.vehicle_stamp),
        ]
    }
}
