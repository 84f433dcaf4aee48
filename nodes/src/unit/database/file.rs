//! The file of a unit database.

use super::units::{DATABASE_VERSION, DatabaseError, UnitDatabase};

/// The first bytes of a file of a database.
pub(super) const MARK: &[u8] = b"foley:units\n";

impl UnitDatabase {
    /// The database as one file: a signature, the version, the hash of the conventions, that of all fields, and these.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn to_bytes(&self) -> Result<Vec<u8>, String> {
        let mut out = MARK.to_vec();
        out.extend(self.version.to_le_bytes());
        out.extend(self.conventions.hash());
        let fields = postcard::to_allocvec(self).map_err(|e| e.to_string())?;
        out.extend(blake3::hash(&fields).as_bytes());
        out.extend(fields);
        Ok(out)
    }

    /// The database in such a file.
    ///
    /// # Errors
    /// Other files, other versions, damaged fields.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let head = MARK.len() + 4 + 2 * 32;
        let (Some(signature), Some(rest)) = (bytes.get(..MARK.len()), bytes.get(head..)) else {
            return Err("this is not a unit database: it is too short".into());
        };
        if signature != MARK {
            return Err("this is not a unit database".into());
        }
        let mut version = [0; 4];
        version.copy_from_slice(&bytes[MARK.len()..MARK.len() + 4]);
        let found = u32::from_le_bytes(version);
        if found != DATABASE_VERSION {
            return Err(DatabaseError::Version { found }.to_string());
        }
        let (conventions, fields) = bytes[MARK.len() + 4..head].split_at(32);
        if fields != blake3::hash(rest).as_bytes() {
            return Err(
                "the unit database is damaged or was changed: its content has another hash; write it again"
                    .into(),
            );
        }
        let db: Self =
            postcard::from_bytes(rest).map_err(|e| format!("the unit database is damaged: {e}"))?;
        db.validate().map_err(|e| e.to_string())?;
        if conventions != db.conventions.hash() {
            return Err("the unit database is damaged: its conventions have another hash".into());
        }
        Ok(db)
    }
}
