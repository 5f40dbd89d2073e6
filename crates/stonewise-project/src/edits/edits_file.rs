//! The file of edits.

use super::lines::object_lines;
use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_base::files::write_text;
use stonewise_core::geometry::is_simple;
use stonewise_core::transfer::LabelEdit;
use stonewise_io::text::read_text;
use stonewise_results::Facade;
use stonewise_results::calendar::day_of;

/// Version of the layout.
const FORMAT: u32 = 1;
/// Largest coordinate, metres or pixels: beyond it a number is a slip, such as a world coordinate.
const MAX_COORDINATE: f64 = 1e5;
/// Largest box around a shape on the wall, square metres. 1e5: 1 km of a wall of 100 m.
const MAX_AREA_M2: f64 = 1e5;

/// The edits of a project, in the order in which they are applied.
#[derive(Clone, Debug)]
pub struct EditsFile {
    /// Where they are written.
    pub path: PathBuf,
    /// The unrolled wall on which those in facade coordinates were drawn; absent: that of the run without
    /// edits.
    pub facade: Option<Facade>,
    /// The edits.
    pub edits: Vec<Edit>,
    /// The line of each.
    pub lines: Vec<usize>,
}

/// What an edit does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// The stones at the places `at`, or inside `outline`, are one.
    Merge,
    /// Stones that `line` crosses are two; or what lies inside `outline` is a stone of its own.
    Split,
    /// There is no stone at the places `at`, or inside `outline`.
    Delete,
    /// `outline` is a stone, or `box` holds one.
    Add,
    /// There are no stones inside `outline`.
    Ignore,
}

impl Action {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Merge => "merge",
            Self::Split => "split",
            Self::Delete => "delete",
            Self::Add => "add",
            Self::Ignore => "ignore",
        }
    }
}

/// One correction by hand. Its shape is in metres on the unrolled wall (along, up), or in pixels of `photo`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Edit {
    /// What it does.
    #[serde(rename = "do")]
    pub action: Action,
    /// The photo in whose pixels the shape is given; absent: the unrolled wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photo: Option<String>,
    /// The epoch of that photo; absent: the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epoch: Option<String>,
    /// The epochs whose stones it changes; absent: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epochs: Option<Vec<String>>,
    /// Places in stones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at: Vec<[f64; 2]>,
    /// A line from border to border of a stone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub line: Vec<[f64; 2]>,
    /// A polygon; the first vertex is not repeated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outline: Vec<[f64; 2]>,
    /// Two opposite corners of a box on the wall; the detector outlines the stone in it.
    #[serde(default, rename = "box", skip_serializing_if = "Vec::is_empty")]
    pub corners: Vec<[f64; 2]>,
    /// Who decided it.
    pub who: String,
    /// When: a date, YYYY-MM-DD, with a time or without.
    pub when: String,
    /// Why.
    pub why: String,
}

impl Edit {
    /// The vertices of its shape.
    pub fn shape(&self) -> &[[f64; 2]] {
        [&self.at, &self.line, &self.outline, &self.corners]
            .into_iter()
            .find(|s| !s.is_empty())
            .map_or(&[], Vec::as_slice)
    }

    /// The edit of labels whose shape has these vertices on the wall.
    pub fn on_wall(&self, shape: Vec<Point2<f64>>) -> LabelEdit {
        match self.action {
            Action::Merge if self.outline.is_empty() => LabelEdit::Merge(shape),
            Action::Merge => LabelEdit::MergeInside(shape),
            Action::Split if self.outline.is_empty() => LabelEdit::Split(shape),
            Action::Split => LabelEdit::CutOut(shape),
            Action::Delete if self.outline.is_empty() => LabelEdit::Delete(shape),
            Action::Delete => LabelEdit::DeleteInside(shape),
            Action::Add => LabelEdit::Add(shape),
            Action::Ignore => LabelEdit::Ignore(shape),
        }
    }

    /// Whether it changes the stones of this epoch.
    pub fn concerns(&self, epoch: &str) -> bool {
        self.epochs
            .as_ref()
            .is_none_or(|all| all.iter().any(|e| e == epoch))
    }

    /// What is wrong with it; `None` where it can be applied.
    pub fn mistake(&self) -> Option<String> {
        let word = self.action.word();
        let given = [
            ("at", self.at.len()),
            ("line", self.line.len()),
            ("outline", self.outline.len()),
            ("box", self.corners.len()),
        ];

        let fits = |key: &str| match self.action {
            Action::Merge | Action::Delete => key == "at" || key == "outline",
            Action::Split => key == "line" || key == "outline",
            Action::Add => key == "outline" || key == "box",
            Action::Ignore => key == "outline",
        };

        let wanted = match self.action {
            Action::Merge => {
                "\"at\" with a place [x, y] in each of its stones, two at least, or an \"outline\" around them"
            }
            Action::Delete => "\"at\" with a place [x, y] in each stone, or an \"outline\" around them",
            Action::Split => "\"line\" with two vertices [x, y] or more, or \"outline\" with three or more",
            Action::Add => {
                "\"outline\" with three vertices [x, y] or more, or \"box\" with two opposite corners"
            }
            Action::Ignore => "\"outline\" with three vertices [x, y] or more",
        };
        let present: Vec<_> = given.into_iter().filter(|g| g.1 > 0).collect();
        let least = |key: &str| match (key, self.action) {
            ("at", Action::Delete) => 1,
            ("outline", _) => 3,
            _ => 2,
        };

        let [(key, vertices)] = present[..] else {
            return Some(format!("{word} needs {wanted}, and no other shape"));
        };
        let is_no_box =
            key == "box" && (vertices != 2 || (0..2).any(|k| self.corners[0][k] == self.corners[1][k]));
        if !fits(key) || vertices < least(key) || is_no_box {
            return Some(format!("{word} needs {wanted}"));
        }
        let shape = self.shape();

        if shape
            .iter()
            .flatten()
            .any(|v| !v.is_finite() || v.abs() > MAX_COORDINATE)
        {
            let frame = "metres along and up the unrolled wall, or pixels of a photo";
            return Some(format!(
                "a coordinate beyond {MAX_COORDINATE}: shapes are in {frame}"
            ));
        }

        if self.photo.is_some() && key == "box" {
            return Some("a \"box\" lies on the wall: leave out \"photo\"".to_owned());
        }

        if self.photo.is_none() && self.epoch.is_some() {
            return Some(
                "\"epoch\" belongs to \"photo\"; \"epochs\" says which epochs it changes".to_owned(),
            );
        }

        self.mistake_in_outline().or_else(|| self.mistake_in_signature())
    }

    fn mistake_in_outline(&self) -> Option<String> {
        let ring: Vec<Point2<f64>> = self.outline.iter().copied().map(Point2::from).collect();
        let low = ring.iter().copied().reduce(|a, b| a.inf(&b))?;
        let high = ring.iter().copied().reduce(|a, b| a.sup(&b))?;
        let size = high - low;
        if self.photo.is_none() && size.x * size.y > MAX_AREA_M2 {
            return Some("its outline is larger than a wall: shapes are in metres".to_owned());
        }
        (!is_simple(&ring)).then(|| "its outline crosses itself".to_owned())
    }

    fn mistake_in_signature(&self) -> Option<String> {
        for (key, text) in [("who", &self.who), ("why", &self.why)] {
            if text.trim().is_empty() {
                return Some(format!(
                    "\"{key}\" is empty: the audit names who decided what, and why"
                ));
            }
        }
        let is_date = day_of(self.when.get(..10).unwrap_or("")).is_some();
        (!is_date).then(|| format!("\"when\" is {:?}: write a date as YYYY-MM-DD", self.when))
    }
}

impl EditsFile {
    /// No edits yet.
    pub fn empty(path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            facade: None,
            edits: Vec::new(),
            lines: Vec::new(),
        }
    }

    /// Reads and checks a file of edits.
    ///
    /// # Errors
    /// With the line: no JSON, an unknown key, a shape that does not fit, no signature.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path).map_err(Error::io("reading the edits", path))?;
        let at = |line: usize, message: String| Error::Project {
            path: path.to_path_buf(),
            line,
            message,
        };
        let root: Value = serde_json::from_str(&text).map_err(|e| at(e.line().max(1), e.to_string()))?;
        let root = root.as_object().ok_or_else(|| {
            at(
                1,
                "a file of edits is an object with \"format\" and \"edits\"".to_owned(),
            )
        })?;

        if let Some(key) = root
            .keys()
            .find(|k| !["format", "facade", "edits"].contains(&k.as_str()))
        {
            return Err(at(
                1,
                format!("unknown key {key:?}: known are format, facade, edits"),
            ));
        }

        if root.get("format").and_then(Value::as_u64) != Some(u64::from(FORMAT)) {
            return Err(at(1, format!("\"format\" must be {FORMAT}")));
        }
        let facade = root.get("facade").filter(|v| !v.is_null());
        let facade = facade
            .map(|v| Facade::deserialize(v).map_err(|e| at(1, format!("facade: {e}"))))
            .transpose()?;
        let list = root
            .get("edits")
            .and_then(Value::as_array)
            .ok_or_else(|| at(1, "\"edits\" must be a list".to_owned()))?;
        let lines = object_lines(&text);
        let mut edits = Vec::new();

        for (number, value) in (1..).zip(list) {
            let line = lines.get(number - 1).copied().unwrap_or(1);
            let wrong = |message: String| at(line, format!("edit {number}: {message}"));
            let edit = Edit::deserialize(value).map_err(|e| wrong(e.to_string()))?;
            if let Some(message) = edit.mistake() {
                return Err(wrong(message));
            }
            edits.push(edit);
        }

        Ok(Self {
            path: path.to_path_buf(),
            facade,
            edits,
            lines,
        })
    }

    /// Refuses edits of epochs that the project does not have.
    pub(crate) fn check_epochs(&self, names: &[&str]) -> Result<()> {
        for (index, edit) in self.edits.iter().enumerate() {
            let named = edit.epoch.iter().chain(edit.epochs.iter().flatten());
            for name in named {
                if !names.contains(&name.as_str()) {
                    return Err(Error::Project {
                        path: self.path.clone(),
                        line: self.lines.get(index).copied().unwrap_or(1),
                        message: format!(
                            "edit {}: no epoch {name:?}; the project has {}",
                            index + 1,
                            names.join(", ")
                        ),
                    });
                }
            }
        }
        Ok(())
    }

    /// The place of an edit, for people: `edits.json, edit 3 (line 12)`.
    pub fn place(&self, index: usize) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let line = self
            .lines
            .get(index)
            .map_or(String::new(), |l| format!(" (line {l})"));
        format!("{name}, edit {}{line}", index + 1)
    }

    /// Writes the file, one edit a line.
    ///
    /// # Errors
    /// It cannot be written; an earlier one is kept then.
    pub fn write(&self) -> Result<()> {
        let json =
            |value: serde_json::Result<String>| value.map_err(|e| Error::results(&self.path, e.to_string()));
        let mut text = format!("{{\n\"format\": {FORMAT},\n");
        if let Some(facade) = &self.facade {
            text += &format!("\"facade\": {},\n", json(serde_json::to_string(facade))?);
        }
        let edits = self.edits.iter().map(|e| json(serde_json::to_string(e)));
        let edits = edits.collect::<Result<Vec<_>>>()?;
        text += &format!("\"edits\": [\n{}\n]\n}}\n", edits.join(",\n"));
        write_text(&self.path, &text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(edits: &str) -> Result<EditsFile> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("edits.json");
        std::fs::write(&path, format!("{{\"format\": 1,\n\"edits\": [\n{edits}\n]}}")).unwrap();
        EditsFile::read(&path)
    }

    const SIGNED: &str = "\"who\": \"A. Keller\", \"when\": \"2026-11-20\", \"why\": \"seen on site\"";

    #[test]
    fn edits_come_back_as_they_were_written() {
        let text = format!(
            "{{\"do\": \"merge\", \"at\": [[1, 2], [1.5, 2]], {SIGNED}}},\n{{\"do\": \"split\", \"photo\": \"a.jpg\", \
             \"epoch\": \"2025\", \"line\": [[10, 20], [10, 90]], {SIGNED}}},\n{{\"do\": \"ignore\", \"epochs\": [\"2025\"], \
             \"outline\": [[0, 0], [1, 0], [0, 1]], {SIGNED}}}"
        );
        let file = read(&text).unwrap();
        assert_eq!(file.lines, [3, 4, 5]);
        assert_eq!(file.place(1), "edits.json, edit 2 (line 4)");
        let dir = tempfile::tempdir().unwrap();
        let again = EditsFile {
            path: dir.path().join("again.json"),
            facade: Some(Facade::new(&[])),
            ..file.clone()
        };
        again.write().unwrap();
        let back = EditsFile::read(&again.path).unwrap();
        assert_eq!(back.edits, file.edits);
        assert!(back.facade.is_some());
        assert!(
            file.check_epochs(&["2024"])
                .unwrap_err()
                .to_string()
                .contains(":4: edit 2: no epoch \"2025\"")
        );
        file.check_epochs(&["2025"]).unwrap();
    }

    #[test]
    fn the_example_in_the_docs_is_read_and_the_schema_has_every_edit() {
        let docs = include_str!("../../../../docs/src/edits.md");
        let example = docs
            .split("```json\n")
            .nth(1)
            .unwrap()
            .split("```")
            .next()
            .unwrap();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("edits.json");
        std::fs::write(&path, example).unwrap();
        let file = EditsFile::read(&path).unwrap();
        let words: Vec<&str> = file.edits.iter().map(|e| e.action.word()).collect();
        let schema: Value =
            serde_json::from_str(include_str!("../../../../docs/src/edits.schema.json")).unwrap();
        let edit = &schema["$defs"]["edit"]["properties"];
        assert_eq!(edit["do"]["enum"], serde_json::json!(words));
        for edit_given in &file.edits {
            let written = serde_json::to_value(edit_given).unwrap();
            for key in written.as_object().unwrap().keys() {
                assert!(edit[key].is_object(), "the schema lacks {key}");
            }
        }
    }

    #[test]
    fn every_mistake_names_its_line_and_the_fix() {
        let cases = [
            (r#""do": "merge", "at": [[1, 2]]"#, "a place [x, y] in each"),
            (r#""do": "merge", "line": [[1, 2], [3, 4]]"#, "merge needs \"at\""),
            (r#""do": "delete""#, "delete needs"),
            (r#""do": "split", "line": [[1, 2]]"#, "two vertices"),
            (
                r#""do": "add", "outline": [[0, 0], [1, 1], [1, 0], [0, 1]]"#,
                "crosses itself",
            ),
            (
                r#""do": "add", "outline": [[0, 0], [999, 0], [999, 999]]"#,
                "larger than a wall",
            ),
            (r#""do": "delete", "at": [[1, 4e9]]"#, "a coordinate beyond"),
            (r#""do": "ignore", "box": [[0, 0], [1, 1]]"#, "ignore needs"),
            (r#""do": "add", "box": [[0, 0], [0, 1]]"#, "two opposite corners"),
            (
                r#""do": "add", "photo": "a.jpg", "box": [[0, 0], [1, 1]]"#,
                "lies on the wall",
            ),
            (r#""do": "remove", "at": [[1, 2]]"#, "unknown variant `remove`"),
            (
                r#""do": "delete", "at": [[1, 2]], "because": "x""#,
                "unknown field `because`",
            ),
            (
                r#""do": "delete", "epoch": "2025", "at": [[1, 2]]"#,
                "belongs to \"photo\"",
            ),
        ];
        for (edit, expected) in cases {
            let fine = format!("{{\"do\": \"delete\", \"at\": [[1, 2]], {SIGNED}}},\n");
            let error = read(&format!("{fine}{{{edit}, {SIGNED}}}"))
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("edits.json:4: edit 2: ") && error.contains(expected),
                "{error}"
            );
        }
        let unsigned = r#"{"do": "delete", "at": [[1, 2]], "who": "me", "when": "yesterday", "why": "x"}"#;
        assert!(read(unsigned).unwrap_err().to_string().contains("YYYY-MM-DD"));
        let nobody = unsigned.replace("\"me\"", "\" \"");
        assert!(
            read(&nobody)
                .unwrap_err()
                .to_string()
                .contains("\"who\" is empty")
        );
        assert!(read(unsigned.trim_end_matches('}')).is_err());
    }
}
