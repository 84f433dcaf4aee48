//! The recordings that a node reads: a list, the files in a folder, and a manifest.

use super::manifest::{ManifestEntry, beside, read_manifest};
use crate::core::fault::Reject;
use crate::core::params::{AssetPath, FolderPath};
use crate::core::shape::Shape;

/// Endings of the recordings in a folder.
const ENDINGS: [&str; 6] = ["wav", "wave", "flac", "ogg", "oga", "mp3"];

/// The field of diagnostics about entries of a manifest.
pub(crate) const MANIFEST: &str = "manifest";

/// A recording with its metadata.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ListedRecording<E> {
    /// The parameter that names it, for diagnostics.
    pub field: String,
    /// Its path.
    pub path: String,
    /// Its entry in the manifest; the default for other recordings.
    pub entry: E,
}

/// The parameters that name recordings.
pub(crate) struct RecordingList<'a> {
    pub recordings: &'a [AssetPath],
    pub folder: Option<&'a FolderPath>,
    pub manifest: Option<&'a AssetPath>,
    /// Code of the diagnostics.
    pub code: &'static str,
}

impl RecordingList<'_> {
    /// The recordings of the list, then those of the folder by name, then those of the manifest, in order of its lines.
    ///
    /// # Errors
    /// A folder or a manifest that cannot be read, or no recording.
    pub fn all<E: ManifestEntry, P>(
        &self,
        s: &mut Shape<'_, '_, P>,
    ) -> Result<Vec<ListedRecording<E>>, Reject> {
        let mut found = Vec::new();
        let plain = |field: String, path: &str| {
            let mut entry = E::default();
            if let Some(file) = E::field("file") {
                path.clone_into(file(&mut entry));
            }
            ListedRecording { field, path: path.to_owned(), entry }
        };
        for (k, AssetPath(path)) in self.recordings.iter().enumerate() {
            found.push(plain(format!("recordings[{k}]"), path));
        }
        if let Some(FolderPath(folder)) = self.folder {
            let is_audio = |path: &String| {
                path.rsplit_once('.').is_some_and(|(_, end)| ENDINGS.contains(&end.to_lowercase().as_str()))
            };
            let all = s.folder("folder", folder)?;
            let before = found.len();
            found.extend(all.iter().filter(|path| is_audio(path)).map(|path| plain("folder".into(), path)));
            if found.len() == before {
                let message = format!("{folder:?} has {} files, none of which is a recording", all.len());
                let help = format!("names of recordings end in .{}", ENDINGS.join(", ."));
                return Err(Reject::new(self.code, message).at("folder").help(help));
            }
        }
        if let Some(AssetPath(list)) = self.manifest {
            let wrong = |text: String| Reject::new(self.code, format!("{list:?}: {text}")).at(MANIFEST);
            for mut entry in read_manifest::<E>(&s.bytes(MANIFEST, list)?).map_err(wrong)? {
                let file = E::field("file").map(|file| file(&mut entry).clone()).unwrap_or_default();
                found.push(ListedRecording { field: MANIFEST.into(), path: beside(list, &file), entry });
            }
        }
        if found.is_empty() {
            let reject = Reject::new(self.code, "there is no recording").at("recordings");
            return Err(
                reject.help(format!("give `recordings`, a `folder`, or a `manifest` of {}s", E::NAME))
            );
        }
        Ok(found)
    }
}
