//! The bridge converter's driver against the transactions of its data sheet.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use std::cell::RefCell;

use embedded_hal::spi::{ErrorKind, Operation, SpiDevice};
use embedded_hal_mock::eh1::spi::{Mock, Transaction};
use muslip_control::ads131m02::{
    AdcError, Ads131m02, ChannelConfig, Conversions, Gain, Oversampling, SET_UP_STEPS,
};

/// CRC-16 bit by bit: polynomial 0x1021, seed 0xFFFF, as the data sheet has it.
fn crc(bytes: &[u8]) -> u16 {
    let mut crc = 0xFFFF_u16;
    for &byte in bytes {
        crc ^= u16::from(byte) << 8;
        for _ in 0..8 {
            let carry = crc & 0x8000 != 0;
            crc <<= 1;
            if carry {
                crc ^= 0x1021;
            }
        }
    }
    crc
}

fn sent(command: u16, datum: u16) -> Vec<u8> {
    let mut frame = vec![0; 12];
    frame[..2].copy_from_slice(&command.to_be_bytes());
    frame[3..5].copy_from_slice(&datum.to_be_bytes());
    frame
}

fn received(response: u16, codes: [i32; 2]) -> Vec<u8> {
    let mut frame = Vec::from(response.to_be_bytes());
    frame.push(0);
    for code in codes {
        frame.extend_from_slice(&code.to_be_bytes()[1..]);
    }
    frame.extend_from_slice(&crc(&frame).to_be_bytes());
    frame.push(0);
    frame
}

/// One frame on the bus, chip select around it.
fn frame(command: u16, datum: u16, answer: Vec<u8>) -> [Transaction<u8>; 3] {
    [
        Transaction::transaction_start(),
        Transaction::transfer_in_place(sent(command, datum), answer),
        Transaction::transaction_end(),
    ]
}

const STATUS: u16 = 0x0500 & !(1 << 10) | 0b11;

fn with_bus<T>(
    frames: Vec<[Transaction<u8>; 3]>,
    work: impl FnOnce(&mut Ads131m02<Mock<u8>>) -> T,
) -> T {
    let transactions: Vec<_> = frames.into_iter().flatten().collect();
    let mut spi = Mock::new(&transactions);
    let mut adc = Ads131m02::new(spi.clone(), Oversampling::X2048);
    let result = work(&mut adc);
    spi.done();
    result
}

fn null(response: u16) -> [Transaction<u8>; 3] {
    frame(0x0000, 0, received(response, [0; 2]))
}

/// Register write: command, acknowledgement, read back.
fn write(address: u16, value: u16, held: u16) -> Vec<[Transaction<u8>; 3]> {
    vec![
        frame(0x6000 | address << 7, value, received(STATUS, [0; 2])),
        null(0x4000 | address << 7),
        frame(0xA000 | address << 7, 0, received(STATUS, [0; 2])),
        null(held),
    ]
}

fn reset_and_id(id: u16) -> Vec<[Transaction<u8>; 3]> {
    vec![
        frame(0x0011, 0, received(STATUS, [0; 2])),
        null(0xFF22),
        frame(0xA000, 0, received(0x0500, [0; 2])),
        null(id),
    ]
}

#[test]
fn the_checksum_is_the_one_that_is_published_for_the_data_sheets_polynomial_and_seed() {
    // Catalogue of parametrised CRC algorithms, CRC-16/IBM-3740 ("CCITT-FALSE"): check 0x29B1. The driver is held
    // to this one by every frame of these tests.
    assert_eq!(crc(b"123456789"), 0x29B1);
}

#[test]
fn set_up_resets_identifies_writes_and_reads_back_every_register() {
    let mut frames = reset_and_id(0x2203);
    frames.extend(write(0x02, 0x0110, 0x0110));
    frames.extend(write(0x03, 0x0312, 0x0312));
    // Channel 1 at gain 128, channel 0 at gain 64.
    frames.extend(write(0x04, 0x0076, 0x0076));
    // 1.25 · 2^23 = 0xA00000, and 1 - 2^-23 = 0x7FFFFF.
    frames.extend(write(0x0C, 0xA000, 0xA000));
    frames.extend(write(0x0D, 0x0000, 0x0000));
    frames.extend(write(0x11, 0x7FFF, 0x7FFF));
    frames.extend(write(0x12, 0xFF00, 0xFF00));
    let channels = [
        ChannelConfig {
            gain: Gain::X64,
            gain_calibration: 1.25,
        },
        ChannelConfig {
            gain: Gain::X128,
            gain_calibration: 1.0 - 1.0 / 8_388_608.0,
        },
    ];
    assert_eq!(with_bus(frames, |adc| adc.configure(channels)), Ok(()));
}

#[test]
fn another_device_and_a_register_that_does_not_hold_are_refused() {
    let channels = [ChannelConfig::default(); 2];
    assert_eq!(
        with_bus(reset_and_id(0x2403), |adc| adc.configure(channels)),
        Err(AdcError::OtherDevice(0x2403))
    );
    let mut frames = reset_and_id(0x2203);
    frames.extend(write(0x02, 0x0110, 0x0510));
    assert_eq!(
        with_bus(frames, |adc| adc.configure(channels)),
        Err(AdcError::NotWritten(2))
    );
    let frames = vec![frame(0x0011, 0, received(STATUS, [0; 2])), null(STATUS)];
    assert_eq!(
        with_bus(frames, |adc| adc.configure(channels)),
        Err(AdcError::Reset)
    );
}

/// Reads the mode register, which is the first that is looked at, with two conversions.
fn look(status: u16, mode: u16, codes: [[i32; 2]; 2]) -> Vec<[Transaction<u8>; 3]> {
    vec![
        frame(0xA100, 0, received(status, codes[0])),
        frame(0, 0, received(mode, codes[1])),
    ]
}

#[test]
fn both_codes_are_the_mean_of_two_conversions_with_their_signs() {
    let read = |status, codes| with_bus(look(status, 0x0110, codes), Ads131m02::read);
    for (codes, mean) in [
        ([[5, 6], [7, 6]], [6, 6]),
        ([[-8_388_608, 8_388_607]; 2], [-8_388_608, 8_388_607]),
        ([[-10, 1], [-21, -1]], [-16, 0]),
    ] {
        let fresh = Conversions {
            codes: mean,
            fresh: true,
        };
        assert_eq!(read(STATUS, codes), Ok(fresh));
    }
    assert!(!read(STATUS & !1, [[1, 2]; 2]).unwrap().fresh);
}

#[test]
fn a_wrong_checksum_a_silent_bus_a_reset_and_a_changed_register_are_errors() {
    for bit in 0..88 {
        let mut answer = received(STATUS, [123_456, -654_321]);
        answer[bit / 8] ^= 0x80 >> (bit % 8);
        assert_eq!(
            with_bus(vec![frame(0xA100, 0, answer)], Ads131m02::read),
            Err(AdcError::Checksum),
            "bit {bit}"
        );
    }
    // Nobody there: the line floats low or high.
    for level in [0x00, 0xFF] {
        let silent = vec![frame(0xA100, 0, vec![level; 12])];
        assert_eq!(with_bus(silent, Ads131m02::read), Err(AdcError::Checksum));
    }
    let read = |status, mode| with_bus(look(status, mode, [[0; 2]; 2]), Ads131m02::read);
    assert_eq!(read(STATUS | 1 << 10, 0x0510), Err(AdcError::Reset));
    assert_eq!(read(STATUS, 0x0111), Err(AdcError::NotWritten(2)));
    assert_eq!(
        Ads131m02::new(Broken, Oversampling::X2048).read(),
        Err(AdcError::Spi(ErrorKind::Overrun))
    );
}

/// The converter itself: registers, response to the command before, two conversions kept, at the rate that its clock
/// register says, of a signal through its filter.
struct Converter<'a> {
    signal: &'a dyn Fn(f64) -> f64,
    now_s: f64,
    registers: [u16; 0x20],
    /// To the command before; to none its status.
    response: Option<u16>,
    conversions: u64,
    kept: Vec<i32>,
}

/// Half of the 8.192 MHz that it runs from.
const MODULATOR_HZ: f64 = 4_096_000.0;

impl<'a> Converter<'a> {
    fn new(signal: &'a dyn Fn(f64) -> f64) -> Self {
        let mut converter = Self {
            signal,
            now_s: 0.0,
            registers: [0; 0x20],
            response: None,
            conversions: 0,
            kept: vec![0],
        };
        converter.reset();
        converter
    }

    /// Registers as after power-up: oversampling 1024, gains of 1, the flag of a reset.
    fn reset(&mut self) {
        self.registers = [0; 0x20];
        self.registers[0] = 0x2203;
        self.registers[2] = 0x0510;
        self.registers[3] = 0x030E;
        self.registers[0x0C] = 0x8000;
        self.registers[0x11] = 0x8000;
    }

    fn per_s(&self) -> f64 {
        MODULATOR_HZ / f64::from(128_u32 << (self.registers[3] >> 2 & 7))
    }

    /// The signal through sinc³: three moving means, each one conversion long.
    fn filtered(&self, at_s: f64) -> f64 {
        const PARTS: i32 = 12;
        let part = 1.0 / self.per_s() / f64::from(PARTS);
        let mut sum = 0.0;
        for a in 0..PARTS {
            for b in 0..PARTS {
                for c in 0..PARTS {
                    sum += (self.signal)(at_s - part * f64::from(a + b + c));
                }
            }
        }
        sum / f64::from(PARTS).powi(3)
    }

    fn wait_until(&mut self, now_s: f64) {
        self.now_s = now_s;
        let due = (now_s * self.per_s()) as u64;
        for conversion in due.saturating_sub(2).max(self.conversions)..due {
            let value = self.filtered((conversion + 1) as f64 / self.per_s());
            self.kept.push((value * 1e6) as i32);
        }
        self.conversions = due;
        let old = self.kept.len().saturating_sub(3);
        self.kept.drain(..old);
    }
}

impl embedded_hal::spi::ErrorType for Converter<'_> {
    type Error = ErrorKind;
}

impl SpiDevice for Converter<'_> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        for operation in operations {
            let Operation::TransferInPlace(bytes) = operation else {
                return Err(ErrorKind::Other);
            };
            let command = u16::from_be_bytes([bytes[0], bytes[1]]);
            let datum = u16::from_be_bytes([bytes[3], bytes[4]]);
            let address = usize::from(command >> 7 & 0x3F);
            let fresh = self.kept.len() > 1;
            if fresh {
                self.kept.remove(0);
            }
            let reset = self.registers[2] & 1 << 10;
            let status = 0x0100 | reset | if fresh { 3 } else { 0 };
            let response = self.response.unwrap_or(status);
            bytes.copy_from_slice(&received(response, [self.kept[0]; 2]));
            self.response = match command {
                0x0000 => None,
                0x0011 => {
                    self.reset();
                    Some(0xFF22)
                }
                _ if command >> 13 == 0b101 => Some(self.registers[address]),
                _ => {
                    self.registers[address] = datum;
                    Some(0x4000 | (command & 0x1F80))
                }
            };
        }
        Ok(())
    }
}

/// The bus to a converter that the test looks at as well.
struct Bus<'a>(&'a RefCell<Converter<'a>>);

impl embedded_hal::spi::ErrorType for Bus<'_> {
    type Error = ErrorKind;
}

impl SpiDevice for Bus<'_> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.0.borrow_mut().transaction(operations)
    }
}

/// So many reads at 1 kHz: codes of channel 0, where there are fresh ones.
fn read_on(
    adc: &mut Ads131m02<Bus<'_>>,
    converter: &RefCell<Converter<'_>>,
    reads: usize,
) -> Vec<Option<i32>> {
    (0..reads)
        .map(|_| {
            let now_s = converter.borrow().now_s + 1e-3;
            converter.borrow_mut().wait_until(now_s);
            adc.read()
                .ok()
                .filter(|read| read.fresh)
                .map(|read| read.codes[0])
        })
        .collect()
}

#[test]
fn a_converter_that_resets_itself_or_loses_a_register_is_set_up_again_while_it_is_read() {
    let still = |_: f64| 0.5;
    let converter = RefCell::new(Converter::new(&still));
    let mut adc = Ads131m02::new(Bus(&converter), Oversampling::X2048);
    assert_eq!(adc.configure([ChannelConfig::default(); 2]), Ok(()));
    let set_up = converter.borrow().registers;
    assert_eq!(set_up[4], 0x0066);
    assert!(
        read_on(&mut adc, &converter, 50)[1..]
            .iter()
            .all(|code| *code == Some(500_000))
    );

    let again = |adc: &mut Ads131m02<Bus<'_>>, most_to_notice: usize| {
        let reads = read_on(adc, &converter, 60);
        let bad = reads.iter().filter(|code| code.is_none()).count();
        let noticed = reads.iter().position(Option::is_none).unwrap();
        assert!(noticed < most_to_notice, "{noticed}");
        assert_eq!(bad, 1 + usize::from(SET_UP_STEPS));
        assert!(reads[noticed + bad..].iter().all(Option::is_some));
        assert_eq!(converter.borrow().registers, set_up);
    };
    converter.borrow_mut().reset();
    again(&mut adc, 1);
    // One that does not say so is found by its registers, each looked at in turn.
    for register in [0x02, 0x03, 0x04, 0x0C, 0x0D, 0x11, 0x12] {
        converter.borrow_mut().registers[register] ^= 1 << 4;
        again(&mut adc, 7);
    }
    // Set-up itself is begun anew where it fails.
    converter.borrow_mut().reset();
    read_on(&mut adc, &converter, 9);
    converter.borrow_mut().reset();
    let reads = read_on(&mut adc, &converter, 40);
    assert!(reads[39].is_some());
    assert_eq!(converter.borrow().registers, set_up);
}

#[test]
fn what_folds_onto_a_force_at_1_khz_is_filtered_out() {
    // Largest share of the tone that is left in what is read.
    let left = |hz: f64| {
        let tone = move |s: f64| (core::f64::consts::TAU * hz * s + 0.3).sin();
        let converter = RefCell::new(Converter::new(&tone));
        let mut adc = Ads131m02::new(Bus(&converter), Oversampling::X2048);
        adc.configure([ChannelConfig::default(); 2]).unwrap();
        let codes = read_on(&mut adc, &converter, 60);
        codes[10..]
            .iter()
            .map(|code| f64::from(code.unwrap().abs()) / 1e6)
            .fold(0.0, f64::max)
    };
    for (hz, most) in [
        (1_000.0, 0.005),
        (960.0, 0.03),
        (1_040.0, 0.03),
        (900.0, 0.06),
        (2_000.0, 0.005),
    ] {
        assert!(left(hz) < most, "{hz}: {}", left(hz));
    }
    // And what is wanted is not.
    assert!(left(20.0) > 0.99);
    assert!(left(100.0) > 0.9);
}

/// A bus whose transfer fails, which the mock cannot say.
struct Broken;

impl embedded_hal::spi::ErrorType for Broken {
    type Error = ErrorKind;
}

impl SpiDevice for Broken {
    fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Overrun)
    }
}
