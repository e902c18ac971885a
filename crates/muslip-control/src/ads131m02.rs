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
//! The converter runs at 4,000 conversions a second from 8.192 MHz and is read a thousand times a second. Its data
//! buffer holds two conversions; after a pause the first frame may hold the older of them, so
//! [`Ads131m02::read`] reads two frames and takes the second (section 8.5.1.9.1).

use crc::{CRC_16_IBM_3740, Crc, Table};
use embedded_hal::spi::SpiDevice;

use crate::number::whole_u32;

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
/// Both channels on, oversampling 1024, high resolution.
const CLOCK: u16 = 0x030E;

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
}

/// Two simultaneous conversions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conversions {
    /// Codes of both channels, sign extended.
    pub codes: [i32; 2],
    /// True where both are new since the last read.
    pub fresh: bool,
}

/// The converter on its bus.
#[derive(Debug)]
pub struct Ads131m02<SPI> {
    spi: SPI,
}

struct Frame {
    response: u16,
    codes: [i32; 2],
}

impl<SPI: SpiDevice> Ads131m02<SPI> {
    /// The converter, untouched.
    pub fn new(spi: SPI) -> Self {
        Self { spi }
    }

    /// Resets it, sets it up, and reads every register back.
    ///
    /// # Errors
    /// [`AdcError`]; the converter is then not to be believed.
    pub fn configure(&mut self, channels: [ChannelConfig; 2]) -> Result<(), AdcError<SPI::Error>> {
        self.exchange(COMMAND_RESET, 0)?;
        // Registers are back at their defaults 5 us after the reset; the frame that follows takes twice that
        // at any clock the converter allows. Its response acknowledges the reset.
        if self.exchange(COMMAND_NULL, 0)?.response != RESPONSE_RESET {
            return Err(AdcError::Reset);
        }
        let id = self.register(REGISTER_ID)?;
        if id >> 8 != ID_TWO_CHANNELS {
            return Err(AdcError::OtherDevice(id));
        }
        let [drag, normal] = channels;
        self.write(REGISTER_MODE, MODE)?;
        self.write(REGISTER_CLOCK, CLOCK)?;
        self.write(
            REGISTER_GAIN,
            u16::from(normal.gain as u8) << 4 | u16::from(drag.gain as u8),
        )?;
        for (register, channel) in [
            (REGISTER_GAIN_CALIBRATION_0, drag),
            (REGISTER_GAIN_CALIBRATION_1, normal),
        ] {
            let factor = channel.gain_calibration;
            if !(0.0..2.0).contains(&factor) {
                return Err(AdcError::GainCalibration);
            }
            // Exact: the factor has 24 bits, and so has the register.
            let [_, high, middle, low] = whole_u32(factor * GAIN_CALIBRATION_OF_1).to_be_bytes();
            self.write(register, u16::from_be_bytes([high, middle]))?;
            self.write(register + 1, u16::from_be_bytes([low, 0]))?;
        }
        Ok(())
    }

    /// The newest conversions.
    ///
    /// # Errors
    /// [`AdcError::Spi`], [`AdcError::Checksum`] or [`AdcError::Reset`].
    pub fn read(&mut self) -> Result<Conversions, AdcError<SPI::Error>> {
        let first = self.exchange(COMMAND_NULL, 0)?;
        let second = self.exchange(COMMAND_NULL, 0)?;
        if (first.response | second.response) & STATUS_RESET != 0 {
            return Err(AdcError::Reset);
        }
        Ok(Conversions {
            codes: second.codes,
            fresh: (first.response | second.response) & STATUS_READY == STATUS_READY,
        })
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

    fn write(&mut self, address: u8, value: u16) -> Result<(), AdcError<SPI::Error>> {
        let place = u16::from(address) << 7;
        self.exchange(COMMAND_WRITE | place, value)?;
        let acknowledged = self.exchange(COMMAND_NULL, 0)?.response == RESPONSE_WRITE | place;
        if acknowledged && self.register(address)? == value {
            Ok(())
        } else {
            Err(AdcError::NotWritten(address))
        }
    }
}
