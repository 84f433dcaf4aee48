//! Binary files with a signature, a version and a digest.

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Display;

/// Bytes of version and digest after the signature.
const HEAD: usize = 4 + 32;

/// A file of a body: the signature, the version, the digest of the body, and the body.
#[must_use]
pub fn seal(signature: &[u8], version: u32, body: &[u8]) -> Vec<u8> {
    let mut out = signature.to_vec();
    out.extend(version.to_le_bytes());
    out.extend(blake3::hash(body).as_bytes());
    out.extend(body);
    out
}

/// The body of such a file. `name` is what it contains, and `other_version` the message about a version that is not `version`.
///
/// # Errors
/// Other files, other versions, and bodies with another digest.
pub fn unseal<'a, E: Display>(
    (signature, version): (&[u8], u32),
    name: &str,
    bytes: &'a [u8],
    other_version: impl FnOnce(u32) -> E,
) -> Result<&'a [u8], String> {
    let rest = bytes.strip_prefix(signature).filter(|rest| rest.len() >= HEAD);
    let Some((head, body)) = rest.map(|rest| rest.split_at(HEAD)) else {
        return Err(format!("this is no file of {name}"));
    };
    let found = head.iter().take(4).rev().fold(0, |n, b| n << 8 | u32::from(*b));
    if found != version {
        return Err(other_version(found).to_string());
    }
    if head[4..] != *blake3::hash(body).as_bytes() {
        return Err(format!(
            "the file of {name} is damaged, cut off or was changed: its content has another digest"
        ));
    }
    Ok(body)
}

/// A file of a value, whose body has its fields one after the other.
///
/// # Errors
/// When it cannot be encoded.
pub fn seal_value<T: Serialize>(signature: &[u8], version: u32, value: &T) -> Result<Vec<u8>, String> {
    let body = postcard::to_allocvec(value).map_err(|e| e.to_string())?;
    Ok(seal(signature, version, &body))
}

/// The value of such a file. `name` is what it contains, and `other_version` the message about a version that is not `version`.
///
/// # Errors
/// As [`unseal`], and fields that do not make a value.
pub fn unseal_value<T: DeserializeOwned, E: Display>(
    (signature, version): (&[u8], u32),
    name: &str,
    bytes: &[u8],
    other_version: impl FnOnce(u32) -> E,
) -> Result<T, String> {
    let body = unseal((signature, version), name, bytes, other_version)?;
    postcard::from_bytes(body).map_err(|e| format!("the file of {name} is damaged: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_return_and_damage_is_found() {
        let file = seal(b"sig\n", 3, b"content");
        let read = |bytes: &[u8]| {
            unseal((b"sig\n", 3), "things", bytes, |v| format!("version {v}")).map(<[u8]>::to_vec)
        };
        assert_eq!(read(&file), Ok(b"content".to_vec()));
        assert!(read(&file[..20]).unwrap_err().contains("no file of things"));
        assert!(read(&file[..file.len() - 1]).unwrap_err().contains("digest"));
        assert_eq!(read(&seal(b"sig\n", 4, b"content")), Err("version 4".into()));
    }
}
