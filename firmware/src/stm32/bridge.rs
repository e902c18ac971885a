//! The bridge converter on an SPI, polled: two frames of 12 bytes are 18 us at 10.5 MHz.

use core::ptr;

use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use muslip_control::ads131m02::{Ads131m02, ChannelConfig, Oversampling};
use muslip_control::board::{BridgeQuality, BridgeReading};
use muslip_control::rates::Rates;

use super::bus::Bus;
use super::wait_for;
use crate::registers::{Port, Registers};

/// A byte takes 130 core cycles; far more than this many reads is a dead bus.
const LIMIT: u32 = 2_000;

const SR: u32 = 0x08;
const DR: u32 = 0x0C;

/// An SPI that was set up, with the line that selects the converter on it.
#[derive(Clone, Copy)]
pub struct Spi {
    /// Address of the SPI.
    pub address: u32,
    /// An access to its data register moves as many bytes as it is wide (STM32G4), and not always one (STM32F4).
    pub packs: bool,
    /// The port that selects.
    pub port: Port,
    /// Its line.
    pub line: u32,
}

/// The converter.
pub struct Bridge {
    converter: Ads131m02<Spi>,
}

impl Bridge {
    /// Sets the converter up.
    pub fn start(spi: Spi, rates: Rates) -> Self {
        let mut bridge = Self::untouched(spi, rates);
        // Where that fails the readings are bad, and each tries on.
        bridge
            .converter
            .configure([ChannelConfig::default(); 2])
            .ok();
        bridge
    }

    /// The converter as it is, believed to be set up.
    pub fn untouched(spi: Spi, rates: Rates) -> Self {
        Self {
            converter: Ads131m02::new(spi, Oversampling::of(rates)),
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

#[allow(unsafe_code, reason = "a data register by its address")]
impl Spi {
    fn exchange(&mut self, byte: u8) -> Result<u8, ErrorKind> {
        let data = self.address + DR;
        // TXE is bit 1, RXNE bit 0 (28.5.3).
        let ready = |bit: u32| wait_for(LIMIT, || Bus.read(self.address + SR) & 1 << bit != 0);
        if !ready(1) {
            return Err(ErrorKind::Other);
        }
        // SAFETY: the SPI's data register, in the width that moves one byte.
        unsafe {
            if self.packs {
                ptr::write_volatile(data as *mut u8, byte);
            } else {
                ptr::write_volatile(data as *mut u16, u16::from(byte));
            }
        }
        if !ready(0) {
            return Err(ErrorKind::Other);
        }
        // SAFETY: as above; on a little-endian bus the byte is the lowest.
        Ok(unsafe {
            if self.packs {
                ptr::read_volatile(data as *const u8)
            } else {
                let [byte, _] = ptr::read_volatile(data as *const u16).to_le_bytes();
                byte
            }
        })
    }

    fn select(&self, level: bool) {
        let bits = if level {
            1 << (self.line + 16)
        } else {
            1 << self.line
        };
        // Written whole, it touches this line only.
        Bus.write(self.port.set_reset(), bits);
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

impl ErrorType for Spi {
    type Error = ErrorKind;
}

impl SpiDevice for Spi {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.select(true);
        let mut result = Ok(());
        for operation in operations.iter_mut() {
            result = self.perform(operation);
            if result.is_err() {
                break;
            }
        }
        self.select(false);
        result
    }
}
