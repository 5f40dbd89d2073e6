//! Styles of layers for QGIS.

use std::fmt::Write;
use stonewise_figure::{Scale, escape};
use stonewise_io::layers::LayerStyle;

/// Classes of a scale in the legend, odd so that one holds zero.
const CLASSES: i32 = 9;
/// Colour and width, millimetres, of the outline of a stone.
const OUTLINE: [&str; 2] = ["90,88,84,255", "0.1"];

/// A class of a scale in the legend.
struct Class {
    number: i32,
    /// Filter of the rows in it; the first and the last class are open.
    range: String,
    /// Least and largest value, metres.
    edges: [f64; 2],
    /// Red, green, blue and alpha.
    colour: String,
}

/// The classes of the values of a column.
fn classes(column: &str, scale: Scale) -> impl Iterator<Item = Class> {
    let (low, high) = scale.range_m();
    let edge = move |i: i32| low + (high - low) * f64::from(i) / f64::from(CLASSES);
    (0..CLASSES).map(move |number| {
        let (from, to) = (edge(number), edge(number + 1));
        let range = match number {
            0 => format!("\"{column}\" < {to}"),
            c if c == CLASSES - 1 => format!("\"{column}\" >= {from}"),
            _ => format!("\"{column}\" >= {from} AND \"{column}\" < {to}"),
        };
        let [r, g, b] = scale.colour(scale.step((from + to) / 2.0)).0;
        Class {
            number,
            range,
            edges: [from, to],
            colour: format!("{r},{g},{b},255"),
        }
    })
}

/// Polygons coloured by a column in metres, legend in millimetres; grey hatch where the column is empty.
///
/// `fade`: stones whose motion is not significant are pale.
pub(super) fn stone_style(name: &str, column: &str, scale: Scale, fade: bool) -> LayerStyle {
    let (mut rules, mut symbols) = (String::new(), String::new());
    let mut add = |filter: &str, label: &str, fill: &str, alpha: f64| {
        let key = symbols.matches("<symbol ").count();
        let (filter, label) = (escape(filter), escape(label));
        let _ = write!(
            rules,
            r#"<rule key="r{key}" symbol="{key}" filter="{filter}" label="{label}"/>"#
        );
        let _ = write!(
            symbols,
            r#"<symbol type="fill" name="{key}" alpha="{alpha}" clip_to_extent="1" force_rhr="0">{fill}</symbol>"#
        );
    };
    for Class {
        range,
        edges: [from, to],
        colour,
        ..
    } in classes(column, scale)
    {
        let fill = simple_fill(&colour, "solid", OUTLINE);
        let label = format!("{:.1} to {:.1} mm", from * 1e3, to * 1e3);
        if fade {
            add(&format!("{range} AND \"significant\" = 1"), &label, &fill, 1.0);
            add(
                &format!("{range} AND \"significant\" = 0"),
                &format!("{label}, not significant"),
                &fill,
                0.3,
            );
        } else {
            add(&range, &label, &fill, 1.0);
        }
    }
    add(
        &format!("\"{column}\" IS NULL"),
        "not measured",
        &simple_fill("150,148,142,255", "b_diagonal", OUTLINE),
        1.0,
    );
    let qml = document(&rules, &symbols, 2);
    LayerStyle {
        name: name.into(),
        description: format!("stones by {column}"),
        qml,
    }
}

/// Lines as arrows; pale where the motion is not significant.
pub(super) fn arrow_style() -> LayerStyle {
    let symbol = |name: usize, alpha: f64| {
        format!(
            "<symbol type=\"line\" name=\"{name}\" alpha=\"{alpha}\" clip_to_extent=\"1\" force_rhr=\"0\">\
             <layer class=\"ArrowLine\" enabled=\"1\" locked=\"0\" pass=\"0\">{}\
             <symbol type=\"fill\" name=\"@{name}@0\" alpha=\"1\" clip_to_extent=\"1\" force_rhr=\"0\">{}</symbol></layer></symbol>",
            options(&[
                ("arrow_width", "0.25"),
                ("arrow_start_width", "0.25"),
                ("arrow_width_unit", "MM"),
                ("head_length", "1.2"),
                ("head_thickness", "0.8"),
                ("is_curved", "0"),
                ("is_repeated", "0"),
            ]),
            simple_fill("30,34,40,255", "solid", OUTLINE)
        )
    };
    let rule = |key: usize, value: u8, label: &str| {
        let filter = escape(&format!("\"significant\" = {value}"));
        format!("<rule key=\"r{key}\" symbol=\"{key}\" filter=\"{filter}\" label=\"{label}\"/>")
    };
    let rules = rule(0, 1, "significant") + &rule(1, 0, "not significant");
    let qml = document(&rules, &(symbol(0, 1.0) + &symbol(1, 0.3)), 1);
    LayerStyle {
        name: "Arrows".into(),
        description: "exaggerated displacements".into(),
        qml,
    }
}

/// Lines coloured by a column in metres, legend in millimetres; thin and grey where the column is empty.
pub(super) fn line_style(name: &str, column: &str, scale: Scale) -> LayerStyle {
    let (mut rules, mut symbols) = (String::new(), String::new());
    let mut add = |key: i32, filter: &str, label: &str, colour: &str, width: &str| {
        let (filter, label) = (escape(filter), escape(label));
        let _ = write!(
            rules,
            r#"<rule key="r{key}" symbol="{key}" filter="{filter}" label="{label}"/>"#
        );
        let line = options(&[
            ("line_color", colour),
            ("line_width", width),
            ("line_width_unit", "MM"),
            ("capstyle", "round"),
        ]);
        let _ = write!(
            symbols,
            r#"<symbol type="line" name="{key}" alpha="1" clip_to_extent="1" force_rhr="0"><layer class="SimpleLine" enabled="1" locked="0" pass="0">{line}</layer></symbol>"#
        );
    };
    for Class {
        number,
        range,
        edges: [from, to],
        colour,
    } in classes(column, scale)
    {
        let label = format!("{:.2} to {:.2} mm", from * 1e3, to * 1e3);
        add(number, &range, &label, &colour, "0.9");
    }
    add(
        CLASSES,
        &format!("\"{column}\" IS NULL"),
        "not measured",
        "150,148,142,255",
        "0.2",
    );
    LayerStyle {
        name: name.into(),
        description: format!("lines by {column}"),
        qml: document(&rules, &symbols, 1),
    }
}

/// Outlines of zones, through which the stones below show.
pub(super) fn zone_style() -> LayerStyle {
    let line = simple_fill("0,0,0,0", "no", ["150,30,110,255", "0.8"]);
    let symbol =
        format!(r#"<symbol type="fill" name="0" alpha="1" clip_to_extent="1" force_rhr="0">{line}</symbol>"#);
    LayerStyle {
        name: "Outlines".into(),
        description: "outlines of the zones of deformation".into(),
        qml: document(r#"<rule key="r0" symbol="0" label="zone"/>"#, &symbol, 2),
    }
}

/// A style of rules; `kind` is QGIS's number of the geometry: 1 lines, 2 polygons.
fn document(rules: &str, symbols: &str, kind: u8) -> String {
    format!(
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n\
         <qgis version=\"3.22\" styleCategories=\"Symbology\">\
         <renderer-v2 type=\"RuleRenderer\" symbollevels=\"0\" forceraster=\"0\" enableorderby=\"0\">\
         <rules key=\"root\">{rules}</rules><symbols>{symbols}</symbols></renderer-v2>\
         <layerGeometryType>{kind}</layerGeometryType></qgis>"
    )
}

/// `outline`: colour and width, millimetres.
fn simple_fill(colour: &str, pattern: &str, [outline, width]: [&str; 2]) -> String {
    let list = options(&[
        ("color", colour),
        ("style", pattern),
        ("outline_color", outline),
        ("outline_style", "solid"),
        ("outline_width", width),
        ("outline_width_unit", "MM"),
    ]);
    format!(r#"<layer class="SimpleFill" enabled="1" locked="0" pass="0">{list}</layer>"#)
}

fn options(options: &[(&str, &str)]) -> String {
    let list: String = options.iter().fold(String::new(), |mut out, (name, value)| {
        let _ = write!(out, r#"<Option type="QString" name="{name}" value="{value}"/>"#);
        out
    });
    format!(r#"<Option type="Map">{list}</Option>"#)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_falls_into_exactly_one_rule() {
        let style = stone_style("Out", "d_out", Scale::Diverging(0.05), true);
        assert_eq!(style.qml.matches("<rule key=\"r").count(), 2 * 9 + 1);
        assert_eq!(style.qml.matches("<symbol type").count(), 2 * 9 + 1);
        assert!(style.qml.contains("&quot;d_out&quot; &lt; "));
        assert!(style.qml.contains("IS NULL"));
        assert_eq!(
            stone_style("LoD", "lod95", Scale::Sequential(0.01), false)
                .qml
                .matches("<rule key=\"r")
                .count(),
            10
        );
    }
}
