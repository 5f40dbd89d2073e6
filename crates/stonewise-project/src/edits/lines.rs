//! Where the edits stand in a file.

/// Line, counted from 1, on which each object of the only list of objects in a JSON object begins.
///
/// The text must be valid JSON whose top level is an object, with one list of objects at most directly in it.
pub(super) fn object_lines(text: &str) -> Vec<usize> {
    let (mut open, mut lines, mut line) = (Vec::new(), Vec::new(), 1);
    let (mut quoted, mut escaped) = (false, false);
    for c in text.chars() {
        match c {
            '\n' => line += 1,
            _ if escaped => {}
            '"' => quoted = !quoted,
            '{' | '[' if !quoted => {
                if c == '{' && open == ['{', '['] {
                    lines.push(line);
                }
                open.push(c);
            }
            '}' | ']' if !quoted => {
                open.pop();
            }
            _ => {}
        }
        escaped = quoted && c == '\\' && !escaped;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_found_whatever_their_texts_hold() {
        let text = "{\"format\": 1, \"facade\": {\"a\": [{\"b\": 1}]},\n\"edits\": [\n {\"why\": \"a { \\\" [\"},\n\n \
                    {\"x\": {\"y\": 1}}, {\"why\": \"\\\\\"}]}";
        assert_eq!(object_lines(text), [3, 5, 5]);
        assert!(object_lines("{\"edits\": []}").is_empty());
    }
}
