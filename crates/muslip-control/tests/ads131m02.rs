//! The bridge converter's driver against the transactions of its data sheet.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use embedded_hal::spi::{ErrorKind, Operation, SpiDevice};
use embedded_hal_mock::eh1::spi::{Mock, Transaction};
use muslip_control::ads131m02::{AdcError, Ads131m02, ChannelConfig, Conversions, Gain};

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
    let mut adc = Ads131m02::new(spi.clone());
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
    frames.extend(write(0x03, 0x030E, 0x030E));
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

#[test]
fn both_codes_come_from_the_second_frame_with_their_signs() {
    let frames = vec![
        frame(0, 0, received(STATUS, [5, 6])),
        frame(0, 0, received(STATUS & !3, [-8_388_608, 8_388_607])),
    ];
    assert_eq!(
        with_bus(frames, Ads131m02::read),
        Ok(Conversions {
            codes: [-8_388_608, 8_388_607],
            fresh: true
        })
    );
    let stale = vec![
        frame(0, 0, received(STATUS & !1, [1, 2])),
        frame(0, 0, received(STATUS & !3, [1, 2])),
    ];
    assert!(!with_bus(stale, Ads131m02::read).unwrap().fresh);
}

#[test]
fn a_wrong_checksum_a_silent_bus_and_a_reset_are_errors() {
    for bit in 0..88 {
        let mut answer = received(STATUS, [123_456, -654_321]);
        answer[bit / 8] ^= 0x80 >> (bit % 8);
        assert_eq!(
            with_bus(vec![frame(0, 0, answer)], Ads131m02::read),
            Err(AdcError::Checksum),
            "bit {bit}"
        );
    }
    // Nobody there: the line floats low or high.
    for level in [0x00, 0xFF] {
        let silent = vec![frame(0, 0, vec![level; 12])];
        assert_eq!(with_bus(silent, Ads131m02::read), Err(AdcError::Checksum));
    }
    let reset = vec![
        frame(0, 0, received(STATUS | 1 << 10, [0; 2])),
        frame(0, 0, received(STATUS, [0; 2])),
    ];
    assert_eq!(with_bus(reset, Ads131m02::read), Err(AdcError::Reset));
    assert_eq!(
        Ads131m02::new(Broken).read(),
        Err(AdcError::Spi(ErrorKind::Overrun))
    );
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
