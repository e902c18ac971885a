//! Driver of Texas Instruments' ADS131M02, two 24-bit delta-sigma converters for the force bridges.
//!
//! Source: ADS131M02 data sheet (SBAS853), sections 8.5 (interface) and 8.6 (registers). SPI mode 1 (clock idles
//! low, data is read on its falling edge). A frame is four words of 24 bits each way:
//!
//! ```text
//! to the converter    command    (first datum)   0           0
//! from the converter  response   channel 0       channel 1   CRC-16
//! ```
//!
//! The response is to the command of the frame before; to NULL it is the STATUS register. The checksum is
//! CRC-16 with polynomial 0x1021 and seed 0xFFFF over the three words before it, in the upper 16 bits.
//!
//! The converter makes two conversions a sample ([`Oversampling`]): 2,000 a second from 8.192 MHz where it is read a
//! thousand times a second. Its data buffer holds two (section 8.5.1.9.1): [`Ads131m02::read`] reads both and takes their
//! mean. The mean has a zero at 1 kHz and the converter's own filter (sinc³) one at 2 kHz, where what is read at 1 kHz would
//! fold onto a constant force; at 900 Hz, which folds onto 100 Hz, 5 % are left (78 % of 4,000 conversions a second, of
//! which every fourth is taken). Both delay the force by 1.0 ms.
//!
//! A converter that has reset itself says so in its status; a register that has changed is found by reading one of
//! them with each conversion, in the frame that is there anyway. Then it is set up again, two frames a sample.

use crc::{CRC_16_IBM_3740, Crc, Table};
use embedded_hal::spi::SpiDevice;

use crate::number::whole_u32;
use crate::rates::Rates;

/// Bytes of a frame: four words of 24 bits.
pub const FRAME_BYTES: usize = 12;

static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_IBM_3740);

const COMMAND_NULL: u16 = 0x0000;
const COMMAND_RESET: u16 = 0x0011;
const RESPONSE_RESET: u16 = 0xFF22;
const COMMAND_READ: u16 = 0xA000;
const COMMAND_WRITE: u16 = 0x6000;
const RESPONSE_WRITE: u16 = 0x4000;

const REGISTER_ID: u8 = 0x00;
const REGISTER_MODE: u8 = 0x02;
const REGISTER_CLOCK: u8 = 0x03;
const REGISTER_GAIN: u8 = 0x04;
/// Gain calibration of channel 0, upper 16 of 24 bits; the lower 8 are in the register after it.
const REGISTER_GAIN_CALIBRATION_0: u8 = 0x0C;
const REGISTER_GAIN_CALIBRATION_1: u8 = 0x11;
/// Register value that changes nothing: 2^23.
const GAIN_CALIBRATION_OF_1: f32 = 8_388_608.0;

/// Upper byte of the ID register: two channels.
const ID_TWO_CHANNELS: u16 = 0x22;
/// 24-bit words, SPI time-out on, and the flag of a past reset cleared.
const MODE: u16 = 0x0110;
/// Both channels on, high resolution; the oversampling is in bits 4 to 2.
const CLOCK: u16 = 0x0302;

/// Registers that are set up.
const REGISTERS: usize = 7;
/// Pairs of frames that set it up: reset, identity, and for each register one to write and one to read back.
pub const SET_UP_STEPS: u8 = 2 + 2 * 7;
const _: () = assert!(SET_UP_STEPS as usize == 2 + 2 * REGISTERS);

const STATUS_RESET: u16 = 1 << 10;
const STATUS_READY: u16 = 0b11;

/// Gain of the amplifier before a converter; full scale is 1.2 V over the gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Gain {
    /// 1.2 V.
    X1 = 0,
    /// 600 mV.
    X2,
    /// 300 mV.
    X4,
    /// 150 mV.
    X8,
    /// 75 mV.
    X16,
    /// 37.5 mV.
    X32,
    /// 18.75 mV.
    X64,
    /// 9.375 mV.
    X128,
}

/// Periods of the converter's own clock of 4.096 MHz that make a conversion: two conversions a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Oversampling {
    /// 2,000 conversions a second, for 1,000 samples.
    X2048 = 0b100,
    /// 1,000, for 500 samples.
    X4096 = 0b101,
    /// 500, for 250 samples.
    X8192 = 0b110,
}

impl Oversampling {
    /// That of a board's sampling.
    #[must_use]
    pub const fn of(rates: Rates) -> Self {
        match rates.sample_hz() {
            501.. => Self::X2048,
            251..=500 => Self::X4096,
            _ => Self::X8192,
        }
    }
}

/// Settings of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelConfig {
    /// Gain of the amplifier.
    pub gain: Gain,
    /// Factor that the converter applies to its codes, 0 to below 2, in steps of 2^-23: the bridge's own
    /// calibration against its shunt. 1 changes nothing.
    pub gain_calibration: f32,
}

impl Default for ChannelConfig {
    /// For a bridge of 2 mV/V at 5 V, 10 mV at full load: 18.75 mV full scale.
    fn default() -> Self {
        Self {
            gain: Gain::X64,
            gain_calibration: 1.0,
        }
    }
}

/// Why the converter could not be read or set up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdcError<E> {
    /// The bus failed.
    Spi(E),
    /// A frame's checksum is wrong: noise, or nobody there.
    Checksum,
    /// The converter has reset itself since it was set up.
    Reset,
    /// Something answers that is not an ADS131M02; its ID register.
    OtherDevice(u16),
    /// A register does not hold what was written to it.
    NotWritten(u8),
    /// A gain calibration outside 0..2.
    GainCalibration,
    /// It is being set up again: no conversion yet.
    SettingUp,
}

/// Two simultaneous conversions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conversions {
    /// Codes of both channels, sign extended: the mean of the last two conversions.
    pub codes: [i32; 2],
    /// True where both channels are new since the last read.
    pub fresh: bool,
}

/// The converter on its bus.
#[derive(Debug)]
pub struct Ads131m02<SPI> {
    spi: SPI,
    oversampling: Oversampling,
    /// What each register is to hold.
    registers: [(u8, u16); REGISTERS],
    /// Step of the set-up that comes next; beyond the last it is set up.
    step: u8,
    /// Register that is looked at next.
    looked_at: u8,
}

struct Frame {
    response: u16,
    codes: [i32; 2],
}

impl<SPI: SpiDevice> Ads131m02<SPI> {
    /// The converter, untouched and believed to be set up for two channels as by default.
    pub fn new(spi: SPI, oversampling: Oversampling) -> Self {
        Self {
            spi,
            oversampling,
            registers: registers([ChannelConfig::default(); 2], oversampling),
            step: SET_UP_STEPS,
            looked_at: 0,
        }
    }

    /// Resets it, sets it up, and reads every register back.
    ///
    /// # Errors
    /// [`AdcError`]; [`Ads131m02::read`] then tries again. [`AdcError::GainCalibration`] changes nothing.
    pub fn configure(&mut self, channels: [ChannelConfig; 2]) -> Result<(), AdcError<SPI::Error>> {
        let within = |channel: &ChannelConfig| (0.0..2.0).contains(&channel.gain_calibration);
        if !channels.iter().all(within) {
            return Err(AdcError::GainCalibration);
        }
        self.registers = registers(channels, self.oversampling);
        self.step = 0;
        while self.step < SET_UP_STEPS {
            self.set_up()?;
        }
        Ok(())
    }

    /// The newest conversions, or the next step of the set-up where one is needed: two frames either way.
    ///
    /// # Errors
    /// [`AdcError`]; after any but [`AdcError::Spi`] and [`AdcError::Checksum`] the next reads set it up again.
    pub fn read(&mut self) -> Result<Conversions, AdcError<SPI::Error>> {
        if self.step < SET_UP_STEPS {
            self.set_up()?;
            return Err(AdcError::SettingUp);
        }
        let (address, value) = self.register_at(self.looked_at);
        let first = self.exchange(COMMAND_READ | u16::from(address) << 7, 0)?;
        let second = self.exchange(COMMAND_NULL, 0)?;
        if first.response & STATUS_RESET != 0 {
            self.step = 0;
            return Err(AdcError::Reset);
        }
        if second.response != value {
            self.step = 0;
            return Err(AdcError::NotWritten(address));
        }
        let next = self.looked_at + 1;
        self.looked_at = if usize::from(next) < REGISTERS {
            next
        } else {
            0
        };
        let [a, b] = first.codes;
        let [c, d] = second.codes;
        Ok(Conversions {
            // 25 bits at most; half a code is far below the converter's noise.
            codes: [(a + c) >> 1, (b + d) >> 1],
            fresh: first.response & STATUS_READY == STATUS_READY,
        })
    }

    fn register_at(&self, index: u8) -> (u8, u16) {
        self.registers
            .get(usize::from(index))
            .copied()
            .unwrap_or((REGISTER_MODE, MODE))
    }

    /// One step of the set-up; an error begins it anew.
    fn set_up(&mut self) -> Result<(), AdcError<SPI::Error>> {
        let step = core::mem::take(&mut self.step);
        match step {
            0 => {
                self.exchange(COMMAND_RESET, 0)?;
                // Registers are back at their defaults 5 us after the reset; the frame that follows takes twice
                // that at any clock the converter allows. Its response acknowledges the reset.
                if self.exchange(COMMAND_NULL, 0)?.response != RESPONSE_RESET {
                    return Err(AdcError::Reset);
                }
            }
            1 => {
                let id = self.register(REGISTER_ID)?;
                if id >> 8 != ID_TWO_CHANNELS {
                    return Err(AdcError::OtherDevice(id));
                }
            }
            _ => {
                let (address, value) = self.register_at((step - 2) / 2);
                let place = u16::from(address) << 7;
                let held = if step.is_multiple_of(2) {
                    self.exchange(COMMAND_WRITE | place, value)?;
                    self.exchange(COMMAND_NULL, 0)?.response == RESPONSE_WRITE | place
                } else {
                    self.register(address)? == value
                };
                if !held {
                    return Err(AdcError::NotWritten(address));
                }
            }
        }
        self.step = step + 1;
        Ok(())
    }

    /// One frame: a command and its datum out, the response to the command before in.
    fn exchange(&mut self, command: u16, datum: u16) -> Result<Frame, AdcError<SPI::Error>> {
        let [c1, c0] = command.to_be_bytes();
        let [d1, d0] = datum.to_be_bytes();
        let mut frame: [u8; FRAME_BYTES] = [c1, c0, 0, d1, d0, 0, 0, 0, 0, 0, 0, 0];
        self.spi
            .transfer_in_place(&mut frame)
            .map_err(AdcError::Spi)?;
        let [r1, r0, r, a2, a1, a0, b2, b1, b0, s1, s0, _] = frame;
        let words = [r1, r0, r, a2, a1, a0, b2, b1, b0];
        if CRC.checksum(&words) != u16::from_be_bytes([s1, s0]) {
            return Err(AdcError::Checksum);
        }
        // From the top of an i32, so that the shift back extends the sign.
        let code = |high, middle, low| i32::from_be_bytes([high, middle, low, 0]) >> 8;
        Ok(Frame {
            response: u16::from_be_bytes([r1, r0]),
            codes: [code(a2, a1, a0), code(b2, b1, b0)],
        })
    }

    fn register(&mut self, address: u8) -> Result<u16, AdcError<SPI::Error>> {
        self.exchange(COMMAND_READ | u16::from(address) << 7, 0)?;
        Ok(self.exchange(COMMAND_NULL, 0)?.response)
    }
}

/// What each register is to hold.
fn registers(channels: [ChannelConfig; 2], oversampling: Oversampling) -> [(u8, u16); REGISTERS] {
    let [drag, normal] = channels;
    let gains = u16::from(normal.gain as u8) << 4 | u16::from(drag.gain as u8);
    let [drag, normal] = channels.map(|channel| {
        // Exact: the factor has 24 bits, and so has the register.
        let factor = whole_u32(channel.gain_calibration * GAIN_CALIBRATION_OF_1);
        let [_, high, middle, low] = factor.to_be_bytes();
        [[high, middle], [low, 0]].map(u16::from_be_bytes)
    });
    let ([drag_high, drag_low], [normal_high, normal_low]) = (drag, normal);
    [
        (REGISTER_MODE, MODE),
        (REGISTER_CLOCK, CLOCK | (oversampling as u16) << 2),
        (REGISTER_GAIN, gains),
        (REGISTER_GAIN_CALIBRATION_0, drag_high),
        (REGISTER_GAIN_CALIBRATION_0 + 1, drag_low),
        (REGISTER_GAIN_CALIBRATION_1, normal_high),
        (REGISTER_GAIN_CALIBRATION_1 + 1, normal_low),
    ]
}
