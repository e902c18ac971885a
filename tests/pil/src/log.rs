//! The image's log, from its UART's bytes to lines.

use anyhow::{Context, Result, anyhow, bail};
use defmt_decoder::{DecodeError, Table};

/// Decodes all whole frames, by the format strings in the image's file.
///
/// # Errors
/// The file has no table of format strings, or a frame makes no sense.
pub fn decode(image: &[u8], bytes: &[u8]) -> Result<Vec<String>> {
    let table = Table::parse(image)
        .map_err(|error| anyhow!("{error}"))?
        .context("the image has no log")?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(bytes);
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => lines.push(frame.display_message().to_string()),
            Err(DecodeError::UnexpectedEof) => return Ok(lines),
            Err(DecodeError::Malformed) => bail!("a malformed frame after {lines:?}"),
        }
    }
}
