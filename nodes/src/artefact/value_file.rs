//! Values that a tap writes to a file and a node reads again.

use crate::core::fault::{Fault, Reject};
use crate::core::files::{MemoryFiles, strip_bom};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::params::AssetPath;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use std::fmt::Display;
use std::io::Read;

/// A value with files of its own: [`Data::file`] or JSON writes them, [`artefact_file!`](crate::artefact_file) declares the node that
/// reads them.
pub trait Artefact: Data {
    /// Code of the diagnostics about its files.
    const CODE: &'static str;
    /// Source of such files, as advice after an error.
    const HELP: Option<&'static str> = None;
    /// First bytes of each file, for large files: a check reads only these.
    const MAGIC: &'static [u8] = &[];

    /// Reads a file, and checks its version, its fields and its digest.
    ///
    /// # Errors
    /// A message that names the wrong field.
    fn from_file(bytes: &[u8]) -> Result<Self, String>;

    /// Figures for the summary of a run.
    fn summary(&self) -> Summary;
}

/// Reads JSON, as a tap writes it; the caller checks the fields.
///
/// # Errors
/// A message with the position and the expected field.
pub fn from_json<T: Data>(bytes: &[u8]) -> Result<T, String> {
    serde_json::from_slice(strip_bom(bytes)).map_err(|e| format!("this is no {}: {e}", T::NAME))
}

fn refused<T: Artefact>(path: &AssetPath, problem: impl Display) -> Reject {
    let reject = Reject::new(T::CODE, format!("{:?}: {problem}", path.0)).at("path");
    T::HELP.map_or(reject.clone(), |help| reject.help(help))
}

/// Checks the file of a node before a run.
///
/// # Errors
/// A missing or wrong file.
pub fn check<T: Artefact, P>(path: &AssetPath, s: &mut Shape<'_, '_, P>) -> Result<(), Reject> {
    if T::MAGIC.is_empty() {
        return T::from_file(&s.bytes("path", &path.0)?).map(drop).map_err(|e| refused::<T>(path, e));
    }
    let mut head = vec![0; T::MAGIC.len()];
    let read = s.open("path", &path.0)?.read_exact(&mut head);
    if read.is_ok() && head == T::MAGIC {
        return Ok(());
    }
    Err(refused::<T>(path, format!("this is no {}", T::NAME)))
}

/// Reads the file of a node.
///
/// # Errors
/// A missing or wrong file.
pub fn read<T: Artefact>(path: &AssetPath, cx: &Build<'_>) -> Result<T, Fault> {
    Ok(T::from_file(&cx.bytes("path", &path.0)?).map_err(|e| refused::<T>(path, e))?)
}

/// A file with a value for trials, as a tap writes it.
pub fn trial<T: Artefact>(name: &str, rng: &mut Rng) -> (AssetPath, MemoryFiles) {
    let value = T::trial(rng);
    let mut files = MemoryFiles::default();
    files.insert(name, value.file().unwrap_or_else(|| serde_json::to_vec(&value).unwrap_or_default()));
    (AssetPath(name.to_owned()), files)
}

/// Declares the node that reads an [`Artefact`] from the file that its parameter `path` names.
///
/// The doc comment of the struct is the documentation of the node.
#[macro_export]
macro_rules! artefact_file {
    (
        $(#[doc = $doc:expr])+
        pub struct $node:ident / $params:ident / $ports:ident / $io:ident, version $version:literal;
        $(#[doc = $path_doc:expr])+
        path: $trial:literal;
        $(#[doc = $value_doc:expr])+
        $output:ident: $value:ty;
    ) => {
        $crate::params! {
            $(#[doc = $doc])+
            pub struct $params {
                $(#[doc = $path_doc])+
                path: $crate::core::params::AssetPath;
            }
        }
        $crate::ports! {
            pub struct $ports / $io {
                in {}
                out {
                    $(#[doc = $value_doc])+
                    $output: $crate::core::ports::Value<$value>,
                }
            }
        }

        #[doc = concat!("The node `", stringify!($node), "`.")]
        #[derive(Debug)]
        pub struct $node;

        impl $crate::core::node::Func for $node {
            type Params = $params;
            type Ports = $ports;
            const NAME: &'static str = stringify!($node);
            const VERSION: u32 = $version;

            fn check(
                p: &$params,
                s: &mut $crate::core::shape::Shape<'_, '_, $ports>,
            ) -> Result<(), $crate::core::fault::Reject> {
                $crate::artefact::value_file::check::<$value, _>(&p.path, s)
            }

            fn eval(
                p: &$params,
                cx: &$crate::core::shape::Build<'_>,
                mut io: $io<'_>,
            ) -> Result<$crate::core::node::Summary, $crate::core::fault::Fault> {
                use $crate::artefact::value_file::{Artefact, read};
                let value = read::<$value>(&p.path, cx)?;
                let summary = Artefact::summary(&value);
                io.$output.set(value);
                Ok(summary)
            }

            fn trial(rng: &mut $crate::core::random::Rng) -> ($params, $crate::core::files::MemoryFiles) {
                let (path, files) = $crate::artefact::value_file::trial::<$value>($trial, rng);
                ($params { path }, files)
            }
        }
    };
}
