//! The bridge converter on SPI2, polled: two frames of 12 bytes are 18 us.

use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use muslip_control::ads131m02::{Ads131m02, ChannelConfig};
use muslip_control::board::{BridgeQuality, BridgeReading};
use stm32f4::stm32f405::{GPIOB, SPI2};

use super::bus;
use crate::registers::{self, set_up};
use crate::settings::wait_for;

/// A byte takes 130 core cycles; far more than this many reads is a dead bus.
const LIMIT: u32 = 2_000;
/// Line of GPIOB that selects the converter.
const SELECT_LINE: u32 = 12;

/// The converter.
pub struct Bridge {
    converter: Ads131m02<Bus>,
}

impl Bridge {
    /// SPI2, then the converter.
    pub fn start(spi: SPI2) -> Self {
        set_up(&registers::BRIDGE, &mut bus::Bus);
        let mut converter = Ads131m02::new(Bus(spi));
        // Where that fails the readings are bad, and each tries on.
        converter.configure([ChannelConfig::default(); 2]).ok();
        Self { converter }
    }

    /// The converter as it is, believed to be set up.
    pub fn untouched(spi: SPI2) -> Self {
        Self {
            converter: Ads131m02::new(Bus(spi)),
        }
    }

    /// The newest codes.
    pub fn read(&mut self) -> BridgeReading {
        match self.converter.read() {
            Ok(conversions) => BridgeReading {
                codes: conversions.codes,
                quality: if conversions.fresh {
                    BridgeQuality::Fresh
                } else {
                    BridgeQuality::Stale
                },
            },
            Err(_) => BridgeReading {
                codes: [0; 2],
                quality: BridgeQuality::Bad,
            },
        }
    }
}

/// SPI2 with the converter's select line.
struct Bus(SPI2);

impl Bus {
    fn exchange(&mut self, byte: u8) -> Result<u8, ErrorKind> {
        let status = |bit: u32| self.0.sr().read().bits() as u32 & 1 << bit != 0;
        // TXE is bit 1, RXNE bit 0 (28.5.3).
        if !wait_for(LIMIT, || status(1)) {
            return Err(ErrorKind::Other);
        }
        self.0
            .dr()
            .write(|w| unsafe { w.bits(u16::from(byte) as _) });
        if !wait_for(LIMIT, || status(0)) {
            return Err(ErrorKind::Other);
        }
        Ok(self.0.dr().read().bits() as u8)
    }

    fn select(level: bool) {
        let bits = if level {
            1 << (SELECT_LINE + 16)
        } else {
            1 << SELECT_LINE
        };
        // SAFETY: BSRR is written whole and touches this line only.
        unsafe { (*GPIOB::ptr()).bsrr().write(|w| w.bits(bits)) };
        // The converter wants 20 ns between select and clock.
        cortex_m::asm::delay(8);
    }

    fn perform(&mut self, operation: &mut Operation<'_, u8>) -> Result<(), ErrorKind> {
        match operation {
            Operation::TransferInPlace(bytes) => {
                for byte in bytes.iter_mut() {
                    *byte = self.exchange(*byte)?;
                }
            }
            Operation::Write(bytes) => {
                for &byte in bytes.iter() {
                    self.exchange(byte)?;
                }
            }
            Operation::Read(bytes) => {
                for byte in bytes.iter_mut() {
                    *byte = self.exchange(0)?;
                }
            }
            Operation::Transfer(read, write) => {
                let mut outgoing = write.iter().copied();
                for byte in read.iter_mut() {
                    *byte = self.exchange(outgoing.next().unwrap_or(0))?;
                }
                for byte in outgoing {
                    self.exchange(byte)?;
                }
            }
            Operation::DelayNs(ns) => cortex_m::asm::delay(*ns / 5),
        }
        Ok(())
    }
}

impl ErrorType for Bus {
    type Error = ErrorKind;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        Self::select(true);
        let mut result = Ok(());
        for operation in operations.iter_mut() {
            result = self.perform(operation);
            if result.is_err() {
                break;
            }
        }
        Self::select(false);
        result
    }
}
