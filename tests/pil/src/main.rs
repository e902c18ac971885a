//! Runs the scenarios on an image and prints what they found.
#![forbid(unsafe_code)]

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Parser;
use muslip_control::emulation::Delays;
use muslip_record::Parameters;
use pil::bench::Worst;
use pil::qemu::Qemu;
use pil::rig::Rig;
use pil::scenarios::{self, CYCLES_PER_SAMPLE, Found, WORK_PERCENT};
use pil::serve::Pace;

/// Processor in the loop: the firmware's image in QEMU, in lock-step with the rig simulator.
#[derive(Parser)]
struct Arguments {
    /// The image that is flashed.
    image: PathBuf,
    /// The image that panics.
    panic_image: PathBuf,
    /// Simulated seconds of the endurance run, and of the one at true pace.
    #[arg(long, default_value_t = 10)]
    seconds: u32,
    /// Only scenarios whose name contains this.
    #[arg(long)]
    only: Option<String>,
    /// Instead of all that: the image behind a socket at this address, in real time, for `muslip rig`.
    #[arg(long, value_name = "HOST:PORT")]
    serve: Option<String>,
    /// Where the measured figures go, as lines of `name = value`.
    #[arg(long)]
    figures: Option<PathBuf>,
}

/// A silent client is a fault there as on a rig.
const REAL_TIME: Pace = Pace {
    speed: 1.0,
    waits: false,
};

type Scenario<'a> = (&'a str, Box<dyn Fn() -> Result<Found> + 'a>);

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let (image, panic_image) = (&arguments.image, &arguments.panic_image);
    if let Some(address) = &arguments.serve {
        return serve(address, image);
    }
    let all: Vec<Scenario<'_>> = vec![
        ("greets", Box::new(|| scenarios::greets(image))),
        ("log", Box::new(|| scenarios::log(image))),
        ("ramps", Box::new(|| scenarios::ramps(image))),
        ("full lock", Box::new(|| scenarios::full_lock(image))),
        ("steps", Box::new(|| scenarios::steps(image))),
        ("compensation", Box::new(|| scenarios::compensation(image))),
        (
            "worst estimate",
            Box::new(|| scenarios::worst_estimate(image)),
        ),
        ("slip hold", Box::new(|| scenarios::slip_hold(image))),
        ("interlocks", Box::new(|| scenarios::interlocks(image))),
        ("guards", Box::new(|| scenarios::guards(image))),
        ("byte by byte", Box::new(|| scenarios::byte_by_byte(image))),
        ("corruption", Box::new(|| scenarios::corruption(image))),
        (
            "back pressure",
            Box::new(|| scenarios::back_pressure(image)),
        ),
        ("free run", Box::new(|| scenarios::free_run(image))),
        (
            "fault handlers",
            Box::new(|| scenarios::fault_handlers(image, panic_image)),
        ),
        (
            "endurance",
            Box::new(|| scenarios::endurance(image, arguments.seconds)),
        ),
        (
            "true pace",
            Box::new(|| scenarios::true_pace(image, arguments.seconds)),
        ),
    ];
    let mut worst = Worst::default();
    let mut failed = 0;
    for (name, scenario) in all {
        if arguments
            .only
            .as_ref()
            .is_some_and(|only| !name.contains(only.as_str()))
        {
            continue;
        }
        let start = Instant::now();
        match scenario() {
            Ok(found) => {
                worst = worst.most(found.worst);
                println!(
                    "ok    {name}: {} ({:.1} s)",
                    found.line,
                    start.elapsed().as_secs_f64()
                );
            }
            Err(error) => {
                failed += 1;
                println!("FAIL  {name}: {error:#}");
            }
        }
    }
    let names = ["interrupt", "control", "step"];
    for (name, instructions) in names.into_iter().zip(worst.instructions) {
        let percent = 100.0 * f64::from(instructions) / f64::from(CYCLES_PER_SAMPLE);
        println!("worst {name}: {instructions} instructions, {percent:.1} % of a sample");
        if instructions * 100 > CYCLES_PER_SAMPLE * WORK_PERCENT {
            failed += 1;
            println!("FAIL  more than {WORK_PERCENT} %");
        }
    }
    println!("deepest stack: {} bytes", worst.stack_bytes);
    if let Some(path) = &arguments.figures {
        let [interrupt, control, step] = worst.instructions;
        let [link, sampling] = worst.priorities;
        let (stack, sensors) = (worst.stack_bytes, worst.sensors);
        let Delays {
            receive,
            send,
            masked,
            held_off,
        } = worst.delays;
        let text = format!(
            "interrupt = {interrupt}\ncontrol = {control}\nstep = {step}\nstack = {stack}\n\
             sensors = {sensors}\nreceive = {receive}\nsend = {send}\nmasked = {masked}\n\
             held_off = {held_off}\nlink_priority = {link}\nsampling_priority = {sampling}\n"
        );
        std::fs::write(path, text).with_context(|| path.display().to_string())?;
    }
    if failed > 0 {
        bail!("{failed} failed");
    }
    Ok(())
}

/// One rig and image for all clients, one after the other, for ever; time stands still without one.
fn serve(address: &str, image: &Path) -> Result<()> {
    let listener = TcpListener::bind(address).with_context(|| address.to_owned())?;
    let (mut qemu, _) = Qemu::start(image)?;
    let mut rig = Rig::rolling("rudd:0.85,0.14", 20.0, 1, &Parameters::default())?;
    pil::serve::settle(&mut qemu, &mut rig)?;
    println!("a simulated rig, rolling at 20 m/s: muslip rig --port tcp:{address} status");
    loop {
        let (client, _) = listener.accept()?;
        pil::serve::serve(
            &mut qemu,
            &mut rig,
            client,
            REAL_TIME,
            &AtomicBool::new(false),
        )?;
    }
}
