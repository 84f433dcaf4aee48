//! The recordings that a node reads: a list, the files in a folder, and a list of takes.

use super::takes::{Take, beside, read_takes};
use crate::core::fault::Reject;
use crate::core::params::{AssetPath, FolderPath};
use crate::core::shape::Shape;
use std::collections::BTreeSet;

/// Endings of the recordings in a folder.
const ENDINGS: [&str; 6] = ["wav", "wave", "flac", "ogg", "oga", "mp3"];

/// A recording with what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Source {
    /// The parameter that names it, for diagnostics.
    pub(super) field: String,
    /// Its path.
    pub(super) path: String,
    /// What was struck; `file` is the path as it was given.
    pub(super) take: Take,
}

/// The parameters that name recordings.
pub(super) struct Sources<'a> {
    pub(super) recordings: &'a [AssetPath],
    pub(super) folder: Option<&'a FolderPath>,
    pub(super) manifest: Option<&'a AssetPath>,
    /// Name of the object where the manifest names none.
    pub(super) object: &'a str,
    /// Material of the takes that count; empty for all.
    pub(super) material: &'a str,
    /// Code of the diagnostics.
    pub(super) code: &'static str,
}

impl Sources<'_> {
    /// The recordings of the list, then those of the folder by name, then those of the manifest, in order of its lines.
    ///
    /// # Errors
    /// A folder or a manifest that cannot be read, or no recording.
    pub(super) fn all<P>(&self, s: &mut Shape<'_, '_, P>) -> Result<Vec<Source>, Reject> {
        let mut found = Vec::new();
        for (k, AssetPath(path)) in self.recordings.iter().enumerate() {
            found.push(self.source(format!("recordings[{k}]"), path.clone(), Take::default()));
        }
        if let Some(FolderPath(folder)) = self.folder {
            let is_audio = |path: &String| {
                path.rsplit_once('.').is_some_and(|(_, end)| ENDINGS.contains(&end.to_lowercase().as_str()))
            };
            let all = s.folder("folder", folder)?;
            let before = found.len();
            let paths = all.iter().filter(|path| is_audio(path));
            found.extend(paths.map(|path| self.source("folder".into(), path.clone(), Take::default())));
            if found.len() == before {
                let message = format!("{folder:?} has {} files, none of which is a recording", all.len());
                let help = format!("names of recordings end in .{}", ENDINGS.join(", ."));
                return Err(Reject::new(self.code, message).at("folder").help(help));
            }
        }
        if let Some(AssetPath(list)) = self.manifest {
            found.extend(self.takes(list, &s.bytes("manifest", list)?)?);
        }
        if found.is_empty() {
            let reject = Reject::new(self.code, "there is no recording").at("recordings");
            return Err(reject.help("give `recordings`, a `folder`, or a `manifest` of takes"));
        }
        // Objects without a name are one object, as if all recordings were a list.
        let first = found[0].path.clone();
        for source in &mut found {
            if source.take.object.is_empty() {
                source.take.object.clone_from(&first);
            }
        }
        Ok(found)
    }

    fn source(&self, field: String, path: String, mut take: Take) -> Source {
        if take.object.is_empty() {
            self.object.clone_into(&mut take.object);
        }
        if take.file.is_empty() {
            take.file.clone_from(&path);
        }
        Source { field, path, take }
    }

    fn takes(&self, list: &str, bytes: &[u8]) -> Result<Vec<Source>, Reject> {
        let wrong = |text: String| Reject::new(self.code, text).at("manifest");
        let all = read_takes(bytes).map_err(|text| wrong(format!("{list:?}: {text}")))?;
        let materials: BTreeSet<String> = all.iter().map(|take| take.material.clone()).collect();
        let counts = |take: &Take| self.material.is_empty() || take.material == self.material;
        let takes: Vec<Take> = all.into_iter().filter(counts).collect();
        if takes.is_empty() {
            let named: Vec<String> = materials.iter().map(|name| format!("{name:?}")).collect();
            let message = format!("{list:?}: no take of the material {:?}", self.material);
            return Err(wrong(message)
                .at("material")
                .help(format!("there are takes of {}", named.join(", "))));
        }
        let each = |take: Take| self.source("manifest".into(), beside(list, &take.file), take);
        Ok(takes.into_iter().map(each).collect())
    }
}
