//! The sampling interrupt and the main loop.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m_rt::exception;
use heapless::spsc::Queue;
use muslip_control::board::{Actuators, Board, RawSample, Sensors};
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::{Controller, Resources};
use muslip_control::emulation::Delays;
use muslip_record::State;

use crate::board::Started;
use crate::cell::InterruptCell;
use crate::chip::{Chip, This, ThisBoard, Took};
use crate::counter::{Interrupter, Most, Stopwatch, cycles, keep};
use crate::link::{self, LinkEnd};
use crate::queue::{self, Sender, Taker};
use crate::totals::{LATE, RAISED, WORKED, count};
use crate::{board, dump, fault, log, stack};

/// Samples that may wait for the main loop; more than one is already a missed deadline.
const WAITING_SAMPLES: usize = 4;
/// Samples between two looks at the stack's paint.
const SAMPLES_PER_STACK_CHECK: u32 = 64;

/// True while the main loop works on a sample.
static WORKING: AtomicBool = AtomicBool::new(false);
/// Cycles of the last sampling interrupt without those of the link in it, and the most of any.
static INTERRUPT: AtomicU32 = AtomicU32::new(0);
static WORST_INTERRUPT: Most = Most::new();
/// Most cycles for which every interrupt was masked.
static MASKED: Most = Most::new();

struct Sampler {
    sensors: <ThisBoard as Board>::Sensors,
    samples: Sender<RawSample>,
}

static SAMPLER: InterruptCell<Sampler> = InterruptCell::new();

/// The sampling interrupt, 1,000 times a second by the timer or once for each frame of the emulator.
#[exception]
fn SysTick() {
    if !This::timer_is_taken() {
        sample();
    }
}

/// What the sampling interrupt does.
pub(crate) fn sample() {
    let watch = Stopwatch::start();
    #[allow(unsafe_code, reason = "what the sampling interrupt owns")]
    // SAFETY: only the interrupt that samples calls it, which is one from start to end of a sample.
    let sampler = unsafe { SAMPLER.get() };
    let Some(sampler) = sampler else {
        return;
    };
    This::sampled();
    count(&RAISED);
    let mut raw = sampler.sensors.read();
    // The deadline of a sample is the next one.
    if WORKING.load(Ordering::Relaxed) || !sampler.samples.is_empty() {
        sampler.sensors.dump();
        raw.late = true;
        count(&LATE);
    }
    // Full is late by more than a sample; the brake is dumped already.
    sampler.samples.push(raw);
    let took = watch.own();
    keep(Interrupter::Sampling, took);
    INTERRUPT.store(took, Ordering::Relaxed);
    WORST_INTERRUPT.take(took);
}

/// Takes samples for ever.
pub fn run(started: Started) -> ! {
    let Started {
        board,
        controller,
        link,
    } = started;
    let (sensors, actuators) = board.split();
    let samples = cortex_m::singleton!(: Queue<RawSample, WAITING_SAMPLES> = Queue::new());
    if let (Some(samples), Some(controller), Some(link)) = (samples, controller, link) {
        let (producer, consumer) = queue::split(samples);
        let sampler = Sampler {
            sensors,
            samples: producer,
        };
        #[allow(unsafe_code, reason = "what the sampling interrupt owns")]
        // SAFETY: the timer is started after this.
        unsafe {
            SAMPLER.fill(sampler);
        }
        Loop {
            controller,
            samples: consumer,
            actuators,
            link,
            resources: Resources::default(),
            state: State::Idle,
        }
        .run()
    }
    // Start-up failed, which it cannot: brake dumped, watchdog unfed.
    dump::dump();
    loop {
        cortex_m::asm::nop();
    }
}

struct Loop {
    controller: &'static mut Controller,
    samples: Taker<RawSample>,
    actuators: <ThisBoard as Board>::Actuators,
    link: LinkEnd,
    resources: Resources,
    state: State,
}

impl Loop {
    fn run(mut self) -> ! {
        This::start_sampling();
        loop {
            while let Some(raw) = self.samples.pop() {
                self.work(&raw);
            }
            if !log::is_empty() && This::log(log::pop) {
                continue;
            }
            if This::stays_awake() {
                // Without a look at any register: those are slow in the emulator.
                cortex_m::asm::delay(1_000);
                continue;
            }
            self.sleep();
        }
    }

    /// Sleeps until the next interrupt, unless a sample waits.
    fn sleep(&self) {
        // With interrupts off a sample cannot slip in between the look and the sleep; a pending one
        // still ends it.
        cortex_m::interrupt::disable();
        let start = cycles();
        let ready = self.samples.ready();
        let looked = cycles().wrapping_sub(start);
        if !ready {
            cortex_m::asm::wfi();
        }
        let awake = cycles();
        MASKED.take(looked.wrapping_add(cycles().wrapping_sub(awake)));
        #[allow(unsafe_code, reason = "interrupts are switched on again")]
        // SAFETY: they were on before.
        unsafe {
            cortex_m::interrupt::enable();
        }
    }

    fn work(&mut self, raw: &RawSample) {
        WORKING.store(true, Ordering::Relaxed);
        This::begins_work();
        let watch = Stopwatch::start();
        let output = self.controller.control(raw);
        // What the interrupt has dumped stays dumped until the controller itself says so; between the look and
        // the valves it must not come.
        board::without_sampling(|| {
            let output = if dump::dumped(output == BrakeOutput::DUMPED) {
                BrakeOutput::DUMPED
            } else {
                output
            };
            self.actuators.actuate(output);
        });
        let control = watch.own();
        This::valves_are_set();
        self.controller.set_overrun_bytes(link::overrun_bytes());
        self.controller.set_resources(self.resources);
        self.controller
            .communicate(&mut self.link, &mut self.actuators);
        let step = watch.own();
        let elapsed = watch.elapsed();
        self.actuators.feed_watchdog();
        WORKING.store(false, Ordering::Relaxed);
        count(&WORKED);
        self.account(control, step, elapsed);
    }

    /// What a sample's work took by itself up to the valves, and in all; and in all by the clock.
    fn account(&mut self, control: u32, step: u32, elapsed: u32) {
        let interrupt = INTERRUPT.load(Ordering::Relaxed);
        if elapsed.saturating_add(interrupt) > This::CYCLES_PER_SAMPLE {
            self.controller.overran();
        }
        let worked = WORKED.load(Ordering::Relaxed);
        if worked % SAMPLES_PER_STACK_CHECK == 1 {
            self.resources.stack_used_bytes = stack::used_bytes();
        }
        self.resources.worst_interrupt_cycles = WORST_INTERRUPT.get();
        let [receive, send] = link::worst_cycles();
        self.resources.worst_link_interrupt_cycles = receive.max(send);
        let delays = Delays {
            receive,
            send,
            masked: MASKED.get(),
            held_off: board::sampling_held_off(),
        };
        self.resources.worst_step_cycles = self.resources.worst_step_cycles.max(step);
        This::kick();
        let state = self.controller.state();
        fault::remember(state, self.controller.brake_energy_j());
        if state != self.state {
            defmt::info!(
                "{} -> {}, fault {}",
                self.state,
                state,
                self.controller.fault()
            );
            self.state = state;
        }
        let took = Took {
            interrupt,
            control,
            step,
        };
        let totals = [&RAISED, &WORKED, &LATE].map(|total| total.load(Ordering::Relaxed));
        This::worked(
            worked,
            &took,
            delays,
            self.resources.stack_used_bytes,
            totals,
        );
    }
}
