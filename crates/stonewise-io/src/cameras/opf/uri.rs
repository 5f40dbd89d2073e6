//! References to files as RFC 3986 writes them.

/// The path of a reference, its percent escapes decoded, and what follows the `#`.
pub fn path_and_fragment(uri: &str) -> (String, Option<&str>) {
    match uri.split_once('#') {
        Some((path, fragment)) => (decoded(path), Some(fragment)),
        None => (decoded(uri), None),
    }
}

fn decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let escaped = after.split_first_chunk::<2>().filter(|_| first == b'%');
        let byte = escaped.and_then(|(digits, after)| Some((hexadecimal(*digits)?, after)));
        let (byte, after) = byte.unwrap_or((first, after));
        bytes.push(byte);
        rest = after;
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn hexadecimal(digits: [u8; 2]) -> Option<u8> {
    let [high, low] = digits.map(|digit| char::from(digit).to_digit(16));
    u8::try_from(16 * high? + low?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_decoded_and_broken_ones_are_kept() {
        for (uri, path, fragment) in [
            ("DJI%200001.JPG", "DJI 0001.JPG", None),
            ("m%C3%B6hne/1%.jpg", "möhne/1%.jpg", None),
            ("100%zz%4", "100%zz%4", None),
            ("a%23b.tif#page=1", "a#b.tif", Some("page=1")),
        ] {
            assert_eq!(path_and_fragment(uri), (path.to_owned(), fragment));
        }
    }
}
