//! Both encoders: TIM3 and TIM4 count in quadrature, TIM5 and TIM2 stamp channel A's rising edges.

use muslip_control::board::EncoderReading;
use muslip_control::encoder::rising_edges;
use stm32f4::stm32f405::{TIM2, TIM3, TIM4, TIM5};

use super::bus::Bus;
use crate::registers::{self, set_up};

/// How often a reading is tried again when an edge comes in its middle: a second edge within it is rare.
const TRIES: u32 = 4;

/// Both encoders.
pub struct Encoders {
    wheel: TIM3,
    vehicle: TIM4,
    wheel_stamp: TIM5,
    vehicle_stamp: TIM2,
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
    pub fn start(wheel: TIM3, vehicle: TIM4, wheel_stamp: TIM5, vehicle_stamp: TIM2) -> Self {
        set_up(&registers::ENCODERS, &mut Bus);
        wheel_stamp.egr().write(|w| unsafe { w.bits(1) });
        vehicle_stamp.egr().write(|w| unsafe { w.bits(1) });
        // SAFETY: reading levels has no effect.
        let (wheel_high, vehicle_high) = unsafe {
            (
                (*stm32f4::stm32f405::GPIOC::ptr()).idr().read().bits() & 1 << 6 != 0,
                (*stm32f4::stm32f405::GPIOB::ptr()).idr().read().bits() & 1 << 6 != 0,
            )
        };
        // Odd while A is high, from the start: see `rising_edges`.
        wheel
            .cnt()
            .write(|w| unsafe { w.bits(u32::from(wheel_high) as _) });
        vehicle
            .cnt()
            .write(|w| unsafe { w.bits(u32::from(vehicle_high) as _) });
        set_up(&registers::COUNTERS_ON, &mut Bus);
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
