//! Where the controller is: a serial port, or a socket of an emulated one.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use muslip_record::LINK_BAUD;

/// How long a read waits for a byte.
const READ_WAIT: Duration = Duration::from_millis(5);

/// An open port.
pub struct Port(Box<dyn ReadWrite + Send>);

trait ReadWrite: Read + Write {}

impl<T: Read + Write> ReadWrite for T {}

/// A port that cannot be opened.
#[derive(Debug, thiserror::Error)]
#[error("{port}: {reason}")]
pub struct PortError {
    /// As the user named it.
    pub port: String,
    /// The system's reason.
    pub reason: String,
}

impl Port {
    /// Opens `tcp:HOST:PORT`, `unix:PATH`, or a serial port by its path at the link's speed.
    ///
    /// # Errors
    /// [`PortError`] with the system's reason.
    pub fn open(name: &str) -> Result<Self, PortError> {
        let fail = |reason: String| PortError {
            port: name.to_owned(),
            reason,
        };
        let stream: io::Result<Box<dyn ReadWrite + Send>> =
            if let Some(address) = name.strip_prefix("tcp:") {
                TcpStream::connect(address).and_then(|stream| {
                    stream.set_nodelay(true)?;
                    stream.set_read_timeout(Some(READ_WAIT))?;
                    Ok(Box::new(stream) as _)
                })
            } else if let Some(path) = name.strip_prefix("unix:") {
                open_unix(path)
            } else {
                return serialport::new(name, LINK_BAUD)
                    .timeout(READ_WAIT)
                    .open()
                    .map(|port| Self(Box::new(port)))
                    .map_err(|error| fail(error.to_string()));
            };
        stream.map(Self).map_err(|error| fail(error.to_string()))
    }

    /// Bytes that have arrived; none after a short wait is no error.
    ///
    /// # Errors
    /// The port is gone.
    pub fn receive<'a>(&mut self, buffer: &'a mut [u8]) -> io::Result<&'a [u8]> {
        match self.0.read(buffer) {
            // A socket whose other end has closed; a serial port never answers 0.
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => Ok(buffer.get(..count).unwrap_or_default()),
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::TimedOut
                        | io::ErrorKind::WouldBlock
                        | io::ErrorKind::Interrupted
                ) =>
            {
                Ok(&[])
            }
            Err(error) => Err(error),
        }
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// The port is gone.
    pub fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)?;
        self.0.flush()
    }
}

#[cfg(unix)]
fn open_unix(path: &str) -> io::Result<Box<dyn ReadWrite + Send>> {
    let stream = std::os::unix::net::UnixStream::connect(path)?;
    stream.set_read_timeout(Some(READ_WAIT))?;
    Ok(Box::new(stream))
}

#[cfg(not(unix))]
fn open_unix(_: &str) -> io::Result<Box<dyn ReadWrite + Send>> {
    Err(io::ErrorKind::Unsupported.into())
}
