//! Text of files as editors and other programs save it, and names that look the same.

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};
use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::{Path, PathBuf};
use unicode_normalization::UnicodeNormalization;

/// An XML declaration ends within so many bytes.
const DECLARATION: usize = 200;

/// Why bytes are no text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {}", self.problem())]
pub struct NotText {
    /// Line of the first such character, counted from 1.
    pub line: usize,
    /// Name of the encoding that the file seems to be in.
    pub encoding: &'static str,
}

impl NotText {
    /// All but the line.
    pub fn problem(&self) -> String {
        format!(
            "a character that is not in {}: save the file as UTF-8",
            self.encoding
        )
    }
}

/// Reads a file of text, see [`decode`].
///
/// # Errors
/// The file cannot be read, or is no text.
pub fn read_text(path: &Path) -> Result<String> {
    decode(&std::fs::read(path)?).map_err(|e| Error::new(ErrorKind::InvalidData, e))
}

/// The text of a file's first `bytes`, in which others than text are replaced.
///
/// # Errors
/// The file cannot be read.
pub fn read_head(path: &Path, bytes: u64) -> Result<String> {
    let mut head = Vec::new();
    File::open(path)?.take(bytes).read_to_end(&mut head)?;
    Ok(encoding(&head).decode_with_bom_removal(&head).0.into_owned())
}

/// The text of bytes, without a byte order mark: in the encoding that the mark or an XML declaration names, in UTF-16
/// where every other byte of the first two characters is 0, else in UTF-8.
///
/// # Errors
/// A character is not in that encoding.
pub fn decode(bytes: &[u8]) -> std::result::Result<String, NotText> {
    let encoding = encoding(bytes);
    let (text, is_broken) = encoding.decode_with_bom_removal(bytes);
    match is_broken {
        false => Ok(text.into_owned()),
        true => {
            let before = text.find(char::REPLACEMENT_CHARACTER).unwrap_or(text.len());
            Err(NotText {
                line: 1 + text[..before].matches('\n').count(),
                encoding: encoding.name(),
            })
        }
    }
}

fn encoding(bytes: &[u8]) -> &'static Encoding {
    if let Some((marked, _)) = Encoding::for_bom(bytes) {
        return marked;
    }
    match bytes {
        [first, 0, second, 0, ..] if *first != 0 && *second != 0 => UTF_16LE,
        [0, first, 0, second, ..] if *first != 0 && *second != 0 => UTF_16BE,
        _ => declared(bytes).unwrap_or(UTF_8),
    }
}

/// The encoding that an XML declaration names, which is in ASCII here.
fn declared(bytes: &[u8]) -> Option<&'static Encoding> {
    let head = bytes.strip_prefix(b"<?xml")?;
    let head = String::from_utf8_lossy(&head[..head.len().min(DECLARATION)]);
    let (declaration, _) = head.split_once("?>")?;
    let (_, value) = declaration.split_once("encoding")?;
    let value = value.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next()?;
    let name = value[1..].split(quote).next()?;
    // Declared as UTF-16, but written byte by byte.
    Encoding::for_label(name.as_bytes()).filter(|found| found.is_ascii_compatible())
}

/// A name in the form in which a letter and its accents are one character (Unicode's form C): file systems of Apple
/// store them apart.
pub fn composed(name: &str) -> String {
    name.nfc().collect()
}

/// The path as it is on the disk, where one that looks the same is there: parts that are not found are looked up by
/// their [`composed`] names. A path that does not exist stays as it is.
pub fn as_stored(path: &Path) -> PathBuf {
    if path.exists() {
        return path.to_owned();
    }
    let (Some(parent), Some(name)) = (path.parent(), path.file_name().and_then(|n| n.to_str())) else {
        return path.to_owned();
    };
    let parent = match parent.as_os_str().is_empty() {
        true => PathBuf::from("."),
        false => as_stored(parent),
    };
    let wanted = composed(name);
    let mut entries = std::fs::read_dir(&parent).into_iter().flatten().flatten();
    let twin = entries.find(|entry| entry.file_name().to_str().map(composed).as_ref() == Some(&wanted));
    twin.map_or_else(|| path.to_owned(), |entry| parent.join(entry.file_name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, order: fn(u16) -> [u8; 2]) -> Vec<u8> {
        text.encode_utf16().flat_map(order).collect()
    }

    /// Bytes as the Unicode Standard, section 3.10, and ISO 8859-1 write them.
    #[test]
    fn marks_zeros_and_declarations_name_the_encoding() {
        let xml = "<?xml version='1.0' encoding='UTF-16'?><a>\u{e4}</a>";
        let marked = format!("\u{feff}{xml}");
        for bytes in [
            marked.clone().into_bytes(),
            utf16(&marked, u16::to_le_bytes),
            utf16(&marked, u16::to_be_bytes),
            utf16(xml, u16::to_le_bytes),
            utf16(xml, u16::to_be_bytes),
            xml.into(),
        ] {
            assert_eq!(decode(&bytes).as_deref(), Ok(xml));
        }
        let latin = b"<?xml version=\"1.0\" encoding = \"ISO-8859-1\"?><a>\xe4</a>";
        assert!(decode(latin).unwrap().ends_with("<a>\u{e4}</a>"));
        let broken = decode(b"one\ntwo \xe4\n").unwrap_err();
        assert_eq!((broken.line, broken.encoding), (2, "UTF-8"));
        assert!(decode(&utf16("\u{feff}ab", u16::to_le_bytes)[..5]).is_err());
        assert_eq!(decode(b""), Ok(String::new()));
    }

    #[test]
    fn paths_are_found_in_either_form_of_unicode() {
        let folder = tempfile::tempdir().unwrap();
        let stored = folder.path().join("Ma\u{308}uer").join("u\u{308}ber.laz");
        std::fs::create_dir(stored.parent().unwrap()).unwrap();
        std::fs::write(&stored, "").unwrap();
        let typed = folder.path().join("M\u{e4}uer").join("\u{fc}ber.laz");
        assert_eq!(
            as_stored(&typed).canonicalize().unwrap(),
            stored.canonicalize().unwrap()
        );
        assert_eq!(as_stored(&stored), stored);
        let missing = folder.path().join("other.laz");
        assert_eq!(as_stored(&missing), missing);
    }
}
