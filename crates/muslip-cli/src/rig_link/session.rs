//! Commands with their answers, and telemetry in between.

use std::io;
use std::time::{Duration, Instant};

use muslip_record::{
    Answer, Command, Envelope, FRAME_BYTES, FrameReader, Hello, PROTOCOL_VERSION, Refusal,
    SCHEMA_HASH, Telemetry, encode,
};

use super::parameters::field_name;
use super::port::Port;

/// A sign of life is due every 250 ms.
const KEEP_ALIVE: Duration = Duration::from_millis(80);
/// How long an answer may take before the command is sent again, and how often that is done. A store of
/// parameters may erase a flash sector: seconds.
const ANSWER: Duration = Duration::from_millis(200);
const TRIES: u32 = 25;

/// Why a rig could not be worked with.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The port is gone.
    #[error("the connection to the rig is lost: {0}")]
    Port(#[from] io::Error),
    /// Nobody answers.
    #[error("no answer from the rig")]
    Silent,
    /// The controller's firmware is of another version.
    #[error(
        "the rig speaks protocol {}.{:08x}, this program {}.{:08x}: flash the firmware of this version",
        .0.protocol_version, .0.schema_hash, PROTOCOL_VERSION, SCHEMA_HASH
    )]
    Version(Hello),
    /// The controller refused a command.
    #[error("the rig refuses to {what}: {}", reason(.refusal))]
    Refused {
        /// What was asked.
        what: &'static str,
        /// Its reason.
        refusal: Refusal,
    },
}

fn reason(refusal: &Refusal) -> String {
    match refusal {
        Refusal::WrongState(state) => format!("it is in state {state:?}"),
        Refusal::Interlock(fault) => format!("interlock {fault:?} is active"),
        Refusal::Profile => "a parameter of the profile is out of range".to_owned(),
        Refusal::Parameter(index) => format!("{} is out of range", field_name(*index)),
        Refusal::Unconfirmed => {
            "its parameters are not this rig's; set them with: muslip rig parameters --set"
                .to_owned()
        }
        Refusal::StopUntested => {
            "its emergency stop is untested since it was switched on; open it and close it"
                .to_owned()
        }
        Refusal::NotConfirmed => {
            "nobody has confirmed the fault at the rig; press its button".to_owned()
        }
        Refusal::Moving => "it is moving".to_owned(),
        Refusal::Storage => {
            "the parameters apply until the next reset but could not be stored".to_owned()
        }
    }
}

/// One end of the link.
pub struct Session {
    port: Port,
    reader: FrameReader,
    sequence: u16,
    expected: Option<u16>,
    spoken: Instant,
    lost: u64,
    bad: u64,
}

impl Session {
    /// Says hello and sees that both sides speak the same language.
    ///
    /// # Errors
    /// [`RigError::Port`], [`RigError::Silent`] or [`RigError::Version`].
    pub fn open(port: Port) -> Result<(Self, Hello), RigError> {
        let mut session = Self {
            port,
            reader: FrameReader::new(),
            // A number that the controller's last host is not likely to have ended with.
            sequence: std::process::id() as u16,
            expected: None,
            spoken: Instant::now(),
            lost: 0,
            bad: 0,
        };
        // Ends whatever half frame the controller may have in its reader.
        session.port.send(&[0])?;
        let mut hello = None;
        session.ask("report its version", Command::Hello, |message| {
            if let Telemetry::Hello(found) = message {
                hello = Some(*found);
            }
        })?;
        let hello = hello.ok_or(RigError::Silent)?;
        if hello.protocol_version != PROTOCOL_VERSION || hello.schema_hash != SCHEMA_HASH {
            return Err(RigError::Version(hello));
        }
        (session.lost, session.bad) = (0, 0);
        Ok((session, hello))
    }

    /// Frames that never came, and frames that were none.
    pub fn losses(&self) -> (u64, u64) {
        (self.lost, self.bad)
    }

    /// Sends a command, again until it is answered, and hands on whatever else comes.
    ///
    /// # Errors
    /// [`RigError`].
    pub fn ask(
        &mut self,
        what: &'static str,
        command: Command,
        mut hear: impl FnMut(&Telemetry),
    ) -> Result<(), RigError> {
        self.sequence = self.sequence.wrapping_add(1);
        let sequence = self.sequence;
        for _ in 0..TRIES {
            self.send(sequence, command)?;
            let sent = Instant::now();
            while sent.elapsed() < ANSWER {
                let mut found = None;
                self.receive(|message| match message {
                    Telemetry::Answer { command, answer } if *command == sequence => {
                        found = Some(*answer);
                    }
                    other => hear(other),
                })?;
                match found {
                    Some(Answer::Done) => return Ok(()),
                    Some(Answer::Refused(refusal)) => {
                        return Err(RigError::Refused { what, refusal });
                    }
                    None => {}
                }
            }
        }
        Err(RigError::Silent)
    }

    /// Hands on what has come, after at most some milliseconds, and keeps the link alive.
    ///
    /// # Errors
    /// [`RigError::Port`].
    pub fn listen(&mut self, hear: impl FnMut(&Telemetry)) -> Result<(), RigError> {
        if self.spoken.elapsed() > KEEP_ALIVE {
            self.sequence = self.sequence.wrapping_add(1);
            self.send(self.sequence, Command::KeepAlive)?;
        }
        self.receive(hear)
    }

    fn send(&mut self, sequence: u16, body: Command) -> Result<(), RigError> {
        let mut buffer = [0; FRAME_BYTES];
        let frame = encode(&Envelope { sequence, body }, &mut buffer)
            .map_err(|error| io::Error::other(error.to_string()))?;
        self.port.send(frame)?;
        self.spoken = Instant::now();
        Ok(())
    }

    fn receive(&mut self, mut hear: impl FnMut(&Telemetry)) -> Result<(), RigError> {
        let mut buffer = [0; 4096];
        for &byte in self.port.receive(&mut buffer)? {
            match self.reader.push::<Envelope<Telemetry>>(byte) {
                None => {}
                Some(Err(_)) => self.bad += 1,
                Some(Ok(Envelope { sequence, body })) => {
                    if let Some(expected) = self.expected {
                        self.lost += u64::from(sequence.wrapping_sub(expected));
                    }
                    self.expected = Some(sequence.wrapping_add(1));
                    hear(&body);
                }
            }
        }
        Ok(())
    }
}
