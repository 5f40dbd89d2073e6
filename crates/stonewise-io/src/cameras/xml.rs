//! A small tree of XML elements, enough for camera files.

use super::{CameraError, malformed};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::path::Path;

/// No camera file has elements inside elements to this depth.
const MAX_DEPTH: usize = 64;

/// An element with its attributes, children and own text.
#[derive(Debug, Default)]
pub struct Element {
    pub name: String,
    pub line: usize,
    pub attributes: Vec<(String, String)>,
    pub children: Vec<Element>,
    pub text: String,
}

impl Element {
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes
            .iter()
            .find(|(key, _)| key == name)
            .map(|(_, value)| value.as_str())
    }

    pub fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|child| child.name == name)
    }

    pub fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// "element <name>, line n".
    pub fn place(&self) -> String {
        format!("<{}> in line {}", self.name, self.line)
    }
}

/// Parses a document into its root element.
pub fn parse(text: &str, path: &Path) -> Result<Element, CameraError> {
    let mut reader = Reader::from_str(text);
    let mut open = vec![Element::default()];
    let mut lines = LineCounter::new(text);

    loop {
        let line = lines.line_at(reader.buffer_position());
        let broken =
            |problem: String| malformed(path, format!("line {line}"), format!("broken xml ({problem})"));
        match reader.read_event().map_err(|e| broken(e.to_string()))? {
            Event::Start(_) if open.len() > MAX_DEPTH => {
                return Err(broken(format!(
                    "elements inside elements, more than {MAX_DEPTH} deep"
                )));
            }
            Event::Start(start) => open.push(element(&start, line).map_err(broken)?),
            Event::Empty(start) => {
                let child = element(&start, line).map_err(broken)?;
                append(&mut open, child);
            }
            Event::End(_) => {
                if let Some(done) = open.pop() {
                    append(&mut open, done);
                }
            }
            Event::Text(text) => add_text(&mut open, &text),
            Event::CData(text) => add_text(&mut open, &text),
            Event::GeneralRef(reference) => {
                let raw = format!("&{};", &*reference);
                let text = quick_xml::escape::unescape(&raw).map_err(|e| broken(e.to_string()))?;
                add_text(&mut open, &text);
            }
            Event::Eof if open.len() > 1 => {
                let name = open.last().map(|e| e.name.clone()).unwrap_or_default();
                return Err(broken(format!("<{name}> is never closed: is the file complete?")));
            }
            Event::Eof => break,
            _ => {}
        }
    }

    let root = open
        .pop()
        .and_then(|document| document.children.into_iter().next());
    root.ok_or_else(|| malformed(path, "line 1", "no xml element"))
}

fn element(start: &BytesStart<'_>, line: usize) -> Result<Element, String> {
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|e| e.to_string())?;
        let value = quick_xml::escape::unescape(&attribute.value).map_err(|e| e.to_string())?;
        attributes.push((attribute.key.as_ref().to_owned(), value.into_owned()));
    }
    Ok(Element {
        name: start.name().as_ref().to_owned(),
        line,
        attributes,
        ..Element::default()
    })
}

fn append(open: &mut [Element], child: Element) {
    if let Some(parent) = open.last_mut() {
        parent.children.push(child);
    }
}

fn add_text(open: &mut [Element], text: &str) {
    if let Some(element) = open.last_mut() {
        element.text.push_str(text);
    }
}

/// Line numbers of growing byte offsets.
struct LineCounter<'a> {
    text: &'a [u8],
    offset: usize,
    line: usize,
}

impl<'a> LineCounter<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            text: text.as_bytes(),
            offset: 0,
            line: 1,
        }
    }

    fn line_at(&mut self, offset: u64) -> usize {
        let offset = usize::try_from(offset).unwrap_or(usize::MAX).min(self.text.len());
        if offset > self.offset {
            let passed = &self.text[self.offset..offset];
            self.line += passed.iter().filter(|&&byte| byte == b'\n').count();
            self.offset = offset;
        }
        self.line
    }
}
