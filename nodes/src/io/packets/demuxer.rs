//! Calls into the demuxers of `symphonia`, guarded against panics.

use std::cell::Cell;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use symphonia::core::errors::Error as CodecError;
use symphonia::core::formats::{FormatOptions, FormatReader};
use symphonia::core::io::MediaSourceStream;
use symphonia::core::packet::Packet;
use symphonia::default::formats;

use crate::io::{AudioError, FileFormat};

/// Number of consecutive errors that end a stream.
const MAX_ERRORS: u32 = 256;

/// Opens the demuxer of a format.
pub(super) fn demux<'s>(
    format: FileFormat,
    stream: MediaSourceStream<'s>,
) -> Result<Box<dyn FormatReader + 's>, AudioError> {
    let options = FormatOptions::default();
    let open = || -> Result<Box<dyn FormatReader + 's>, CodecError> {
        Ok(match format {
            FileFormat::Flac => Box::new(formats::FlacReader::try_new(stream, options)?),
            #[cfg(feature = "compressed-audio")]
            FileFormat::Ogg => Box::new(formats::OggReader::try_new(stream, options)?),
            #[cfg(feature = "compressed-audio")]
            _ => Box::new(formats::MpaReader::try_new(stream, options)?),
            #[cfg(not(feature = "compressed-audio"))]
            _ => return Err(CodecError::Unsupported("the feature `compressed-audio` reads it")),
        })
    };
    guarded(open).unwrap_or(Err(PANICKED)).map_err(|e| codec_error(format, e))
}

/// Error of a call that panicked.
pub(super) const PANICKED: CodecError = CodecError::DecodeError("its decoder panicked");

thread_local! {
    /// True while a panic of this thread is caught, and reported as an error of the file.
    static CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Lets the panic hook print nothing for panics that are caught.
fn install_hook() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !CAUGHT.get() {
                print(info);
            }
        }));
    });
}

/// Calls code of `symphonia`; returns `None` if it panics, and prints nothing then.
pub(super) fn guarded<T>(call: impl FnOnce() -> T) -> Option<T> {
    install_hook();
    let before = CAUGHT.replace(true);
    let result = catch_unwind(AssertUnwindSafe(call)).ok();
    CAUGHT.set(before);
    result
}

pub(super) fn codec_error(format: FileFormat, error: CodecError) -> AudioError {
    match error {
        CodecError::IoError(e) if e.kind() != io::ErrorKind::UnexpectedEof => AudioError::Io(e),
        CodecError::Unsupported(what) => AudioError::Unsupported {
            found: format!("this {} file ({what})", format.name()),
            wanted: if cfg!(feature = "compressed-audio") {
                "FLAC, Vorbis and MPEG layer III are supported"
            } else {
                "this build reads WAV and FLAC"
            },
        },
        CodecError::IoError(_) => {
            AudioError::Undecodable { format: format.name(), what: "it ends within its header".into() }
        }
        other => AudioError::Undecodable { format: format.name(), what: other.to_string() },
    }
}

/// Reason for the end of the packets.
#[derive(PartialEq)]
pub(super) enum End {
    /// The source ends or fails.
    Last,
    /// Another stream with its own headers follows.
    Chained,
}

/// The next packet of the track; skips corrupt segments, and treats a failing source as an end.
pub(super) fn next_packet(demuxer: &mut dyn FormatReader, track: u32) -> Result<Packet, End> {
    let mut errors = 0;
    while errors < MAX_ERRORS {
        match guarded(|| demuxer.next_packet()).ok_or(End::Last)? {
            Ok(Some(packet)) if packet.track_id == track => return Ok(packet),
            Ok(Some(_)) => {}
            Err(CodecError::ResetRequired) => return Err(End::Chained),
            Ok(None) | Err(CodecError::IoError(_)) => return Err(End::Last),
            Err(_) => errors += 1,
        }
    }
    Err(End::Last)
}
