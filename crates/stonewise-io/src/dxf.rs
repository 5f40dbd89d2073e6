//! Drawings for CAD as DXF of release 12, which every CAD program opens.

use crate::atomic::write_atomically;
use nalgebra::Point2;
use std::collections::BTreeMap;
use std::fmt::{Display, Write};
use std::path::Path;
use std::{fs, io};

/// A flat drawing, metres.
#[derive(Clone, Debug, Default)]
pub struct Drawing {
    /// Layers by name with their colours, numbers of AutoCAD's colour index. Names are of A to Z, 0 to 9 and _.
    pub layers: BTreeMap<String, u8>,
    /// What is drawn, the lowest first.
    pub shapes: Vec<Shape>,
}

/// Something drawn on a layer.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Name of its layer.
    pub layer: String,
    /// What it is.
    pub form: Form,
}

/// What is drawn.
#[derive(Clone, Debug)]
pub enum Form {
    /// A line through vertices, which may return to its first.
    Line {
        /// Its vertices.
        vertices: Vec<Point2<f64>>,
        /// Whether it returns.
        is_closed: bool,
    },
    /// A line of text.
    Text {
        /// Its middle.
        middle: Point2<f64>,
        /// Height of its capitals, metres.
        height_m: f64,
        /// What it says.
        text: String,
    },
}

/// Writes a drawing, coordinates to 0.01 mm; shapes with coordinates that are not finite are left out.
///
/// Source: Autodesk, "DXF Reference" of release 12 (1992). That release states no unit: 1 is a metre.
///
/// # Errors
/// The file cannot be written; an earlier file is kept then.
pub fn write_dxf(path: &Path, drawing: &Drawing) -> io::Result<()> {
    let text = dxf(drawing);
    write_atomically(path, |partial| fs::write(partial, text))
}

fn dxf(drawing: &Drawing) -> String {
    let mut out = Groups::default();
    out.section("HEADER");
    out.tag(9, "$ACADVER").tag(1, "AC1009");
    out.tag(0, "ENDSEC");
    out.section("TABLES");
    out.tag(0, "TABLE").tag(2, "LTYPE").tag(70, 1);
    out.tag(0, "LTYPE").tag(2, "CONTINUOUS").tag(70, 0);
    out.tag(3, "Solid line").tag(72, 65).tag(73, 0).tag(40, "0.0");
    out.tag(0, "ENDTAB");
    out.tag(0, "TABLE").tag(2, "LAYER").tag(70, drawing.layers.len());
    for (name, colour) in &drawing.layers {
        out.tag(0, "LAYER").tag(2, name).tag(70, 0);
        out.tag(62, colour).tag(6, "CONTINUOUS");
    }
    out.tag(0, "ENDTAB");
    out.tag(0, "ENDSEC");
    out.section("ENTITIES");
    for shape in drawing.shapes.iter().filter(|shape| shape.is_finite()) {
        match &shape.form {
            Form::Line { vertices, is_closed } => {
                out.tag(0, "POLYLINE").tag(8, &shape.layer).tag(66, 1);
                out.place(0, &Point2::origin()).tag(70, u8::from(*is_closed));
                for vertex in vertices {
                    out.tag(0, "VERTEX").tag(8, &shape.layer).place(0, vertex);
                }
                out.tag(0, "SEQEND").tag(8, &shape.layer);
            }
            Form::Text {
                middle,
                height_m,
                text,
            } => {
                out.tag(0, "TEXT").tag(8, &shape.layer).place(0, middle);
                out.tag(40, format!("{height_m:.5}")).tag(1, escaped(text));
                // Centred both ways on the second place.
                out.tag(72, 1).place(1, middle).tag(73, 2);
            }
        }
    }
    out.tag(0, "ENDSEC");
    out.tag(0, "EOF");
    out.0
}

impl Shape {
    fn is_finite(&self) -> bool {
        let finite = |p: &Point2<f64>| p.iter().all(|v| v.is_finite());
        match &self.form {
            Form::Line { vertices, .. } => vertices.iter().all(finite),
            Form::Text { middle, height_m, .. } => finite(middle) && height_m.is_finite(),
        }
    }
}

/// Pairs of a group's code and its value.
#[derive(Default)]
struct Groups(String);

impl Groups {
    fn tag(&mut self, code: u16, value: impl Display) -> &mut Self {
        // Writing into a string does not fail.
        let _ = writeln!(self.0, "{code:>3}\n{value}");
        self
    }

    /// A place, the `k`-th of its entity.
    fn place(&mut self, k: u16, place: &Point2<f64>) -> &mut Self {
        self.tag(10 + k, format!("{:.5}", place.x));
        self.tag(20 + k, format!("{:.5}", place.y)).tag(30 + k, "0.0")
    }

    fn section(&mut self, name: &str) {
        self.tag(0, "SECTION").tag(2, name);
    }
}

/// A line of text as the format takes it: in ASCII, other characters by their code points.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            ' '..='~' => out.push(c),
            c if c.is_control() => out.push(' '),
            c => {
                let mut units = [0; 2];
                for unit in c.encode_utf16(&mut units) {
                    let _ = write!(out, "\\U+{unit:04X}");
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_and_a_text_are_the_groups_of_the_reference() {
        let shape = |layer: &str, form| Shape {
            layer: layer.to_owned(),
            form,
        };
        let line = |x: f64| Form::Line {
            vertices: vec![Point2::new(x, 0.0), Point2::new(1.0, 2.5)],
            is_closed: true,
        };
        let text = Form::Text {
            middle: Point2::new(0.5, -1.0),
            height_m: 0.1,
            text: "\u{e4}\n7".to_owned(),
        };
        let drawing = Drawing {
            layers: [("A".to_owned(), 1)].into(),
            shapes: vec![
                shape("A", line(0.0)),
                shape("A", line(f64::NAN)),
                shape("A", text),
            ],
        };
        let found = dxf(&drawing);
        let (_, entities) = found.split_once("ENTITIES\n").unwrap();
        let groups: Vec<&str> = entities.lines().map(str::trim).collect();
        let expected = "0 POLYLINE 8 A 66 1 10 0.00000 20 0.00000 30 0.0 70 1 \
                        0 VERTEX 8 A 10 0.00000 20 0.00000 30 0.0 0 VERTEX 8 A 10 1.00000 20 2.50000 30 0.0 0 SEQEND 8 A \
                        0 TEXT 8 A 10 0.50000 20 -1.00000 30 0.0 40 0.10000 1 \\U+00E4_7 72 1 \
                        11 0.50000 21 -1.00000 31 0.0 73 2 0 ENDSEC 0 EOF";
        let found: Vec<String> = groups.iter().map(|g| g.replace(' ', "_")).collect();
        assert_eq!(found.join(" "), expected);
    }
}
