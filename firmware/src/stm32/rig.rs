//! The rig on an STM32: sensors, valves, watchdog and flash, by the tables of a board.

use core::marker::PhantomData;

use muslip_control::board::{Actuators, Board, NotStored, RawSample, Sensors};
use muslip_control::brake::BrakeOutput;
use muslip_control::rates::Rates;
use muslip_control::store::{Loaded, Store};
use muslip_record::Parameters;

use super::bridge::{Bridge, Spi};
use super::bus::Bus;
use super::encoders::Encoders;
use super::flash::{self, ParameterFlash};
use super::millivolt;
use super::outputs::{self, DumpPin, ValvePwm};
use super::watchdog::Watchdog;
use crate::registers::{Port, Registers, Setting, first_wrong, set_up};
use crate::valves::Valves;

/// Line of port B that holds pressure while it is high.
const DUMP_LINE: u32 = 0;
/// Lines that are high while the emergency stop's channels are closed: of port B, and of port C.
const EMERGENCY_STOP_LINES: [u32; 2] = [1, 4];
/// Line of port B that is high while the button at the rig is pressed.
const CONFIRM_LINE: u32 = 10;
/// Line of port B that selects the bridge's converter, and of port C that holds its reset high.
const BRIDGE_LINES: [u32; 2] = [12, 5];
/// Line of channel A of either encoder: of port C the wheel's, of port B the vehicle's.
const ENCODER_LINE: u32 = 6;

/// Supply of the valves in mV that makes a converter's full scale: 3.3 V behind a divider of 10:1.
const SUPPLY_FULL_SCALE_MV: u32 = 36_300;
/// Voltage in mV of a pin that makes it.
const PIN_FULL_SCALE_MV: u32 = 3_300;

/// A board's tables, and where its peripherals are.
pub struct Tables {
    /// Ports A, B and C.
    pub ports: [Port; 3],
    /// Their clocks.
    pub port_clocks: &'static [Setting],
    /// The dump valve's pin as an output, and as TIM1's.
    pub dump_pin: [&'static [Setting]; 2],
    /// All other pins.
    pub pins: &'static [Setting],
    /// TIM1: its address, its clock and what is before its outputs, its outputs.
    pub tim1: u32,
    /// The second of these.
    pub valves_clock: &'static [Setting],
    /// The third.
    pub valves: &'static [Setting],
    /// Steps of the proportional valve's PWM.
    pub valve_period: u32,
    /// Clocks of the encoders' timers.
    pub encoders_clock: &'static [Setting],
    /// The bridge's SPI: its address, whether it packs, its set-up.
    pub spi: u32,
    /// See [`Spi::packs`].
    pub spi_packs: bool,
    /// Its set-up.
    pub bridge: &'static [Setting],
    /// All that is held against the chip after start-up.
    pub checked: &'static [&'static [Setting]],
}

/// A chip that the rig can be on.
pub trait Chip {
    /// Its tables.
    const TABLES: Tables;
    /// Its rates.
    const RATES: Rates;
    /// Where it keeps parameters.
    type Flash: flash::Interface;

    /// Starts both converters and their first conversions, so that the first sample finds one of each.
    fn start_converters();

    /// Twelve bits of the conversions of supply and pressure started a sample ago, and the next ones started; 0 where there is
    /// none, at which what it measures counts as lost.
    fn converted() -> [u16; 2];
}

/// The rig's sensors.
pub struct RigSensors<C> {
    encoders: Encoders<Bus>,
    bridge: Bridge,
    chip: PhantomData<C>,
}

/// The rig's valves, watchdog and flash.
pub struct RigActuators<C: Chip> {
    valves: Valves<ValvePwm<Bus>, DumpPin<Bus>>,
    store: Store<ParameterFlash<C::Flash, Bus>>,
    watchdog: Watchdog<Bus>,
}

/// Both.
pub struct Rig<C: Chip> {
    /// The sensors.
    pub sensors: RigSensors<C>,
    /// The valves.
    pub actuators: RigActuators<C>,
}

impl<C: Chip> Board for Rig<C> {
    type Sensors = RigSensors<C>;
    type Actuators = RigActuators<C>;

    fn split(self) -> (RigSensors<C>, RigActuators<C>) {
        (self.sensors, self.actuators)
    }
}

/// The dump valve's pin is an output and low: before anything else, with the ports' clock and nothing more.
pub fn dump_line_low<C: Chip>() {
    let tables = C::TABLES;
    let [_, port_b, _] = tables.ports;
    set_up(tables.port_clocks, &mut Bus);
    Bus.write(port_b.set_reset(), 1 << (DUMP_LINE + 16));
    let [output, _] = tables.dump_pin;
    set_up(output, &mut Bus);
}

/// Dumps the brake, from any context: the pin for before TIM1 has it, written whole, so that it touches this line only.
pub fn dump<C: Chip>() {
    let tables = C::TABLES;
    let [_, port_b, _] = tables.ports;
    Bus.write(port_b.set_reset(), 1 << (DUMP_LINE + 16));
    outputs::off(tables.tim1, &mut Bus);
}

/// Pins and peripherals, once clocks run; and what the flash holds.
pub fn start<C: Chip>() -> (Rig<C>, Option<Loaded>) {
    let tables = C::TABLES;
    let [_, port_b, port_c] = tables.ports;
    // The bridge converter's select and reset are high before they are outputs.
    for (port, line) in [port_b, port_c].into_iter().zip(BRIDGE_LINES) {
        Bus.write(port.set_reset(), 1 << line);
    }
    set_up(tables.pins, &mut Bus);
    C::start_converters();
    set_up(tables.valves_clock, &mut Bus);
    set_up(tables.valves, &mut Bus);
    let [_, on_timer] = tables.dump_pin;
    set_up(on_timer, &mut Bus);
    let (proportional, dump) = outputs::outputs(Bus, tables.tim1, tables.valve_period);
    let valves = Valves::new(proportional, dump);
    let mut store = Store::new(ParameterFlash::new(Bus));
    let loaded = store.load().ok().flatten();
    set_up(tables.encoders_clock, &mut Bus);
    let levels = [port_c, port_b].map(|port| Bus.read(port.levels()) & 1 << ENCODER_LINE != 0);
    let encoders = Encoders::start(Bus, levels);
    set_up(tables.bridge, &mut Bus);
    let rig = Rig {
        sensors: RigSensors {
            encoders,
            bridge: Bridge::start(spi::<C>(), C::RATES),
            chip: PhantomData,
        },
        actuators: RigActuators {
            valves,
            store,
            watchdog: Watchdog::new(Bus),
        },
    };
    (rig, loaded)
}

fn spi<C: Chip>() -> Spi {
    let tables = C::TABLES;
    let ([_, port, _], [line, _]) = (tables.ports, BRIDGE_LINES);
    Spi {
        address: tables.spi,
        packs: tables.spi_packs,
        port,
        line,
    }
}

/// Whether every register that was set up holds what it should; the first that does not is logged.
pub fn registers_hold<C: Chip>() -> bool {
    let wrong = first_wrong(C::TABLES.checked, &mut Bus);
    if let Some((setting, read)) = wrong {
        defmt::error!(
            "register {=str} holds {=u32:08x}, not {=u32:08x} in {=u32:08x}",
            setting.name,
            read,
            setting.value,
            setting.mask
        );
    }
    wrong.is_none()
}

impl<C: Chip> RigSensors<C> {
    /// Sensors as they are, of a chip that was not started.
    pub fn untouched() -> Self {
        Self {
            encoders: Encoders::untouched(Bus),
            bridge: Bridge::untouched(spi::<C>(), C::RATES),
            chip: PhantomData,
        }
    }

    /// The bridge's converter alone.
    pub fn bridge(&mut self) -> &mut Bridge {
        &mut self.bridge
    }
}

impl<C: Chip> Sensors for RigSensors<C> {
    fn read(&mut self) -> RawSample {
        let [wheel, vehicle] = self.encoders.read();
        let [supply, pressure] = C::converted();
        let [_, port_b, port_c] = C::TABLES.ports;
        let (port_b, port_c) = (Bus.read(port_b.levels()), Bus.read(port_c.levels()));
        let [line_b, line_c] = EMERGENCY_STOP_LINES;
        RawSample {
            wheel,
            vehicle,
            bridge: self.bridge.read(),
            supply_mv: millivolt(supply, SUPPLY_FULL_SCALE_MV),
            pressure_mv: millivolt(pressure, PIN_FULL_SCALE_MV),
            emergency_stop: [port_b & 1 << line_b == 0, port_c & 1 << line_c == 0],
            holds: port_b & 1 << DUMP_LINE != 0,
            confirm: port_b & 1 << CONFIRM_LINE != 0,
            late: false,
        }
    }

    fn dump(&mut self) {
        crate::dump::dump();
    }
}

impl<C: Chip> Actuators for RigActuators<C> {
    fn actuate(&mut self, output: BrakeOutput) {
        self.valves.set(output);
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn store(&mut self, parameters: &Parameters) -> Result<(), NotStored> {
        // An erase takes longer than a sample: up to 2 s on an STM32F405.
        let store = &mut self.store;
        self.watchdog
            .while_erasing(|| store.save(parameters))
            .map_err(|_| NotStored)
    }
}
