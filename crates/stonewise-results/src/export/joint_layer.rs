//! The joints as a layer of lines.

use super::layer_style::line_style;
use crate::{Joint, JointMotion, ResultSet, nice_scale_m};
use nalgebra::Point3;
use stonewise_figure::Scale;
use stonewise_io::crs::Crs;
use stonewise_io::layers::{Geometry, Layer};
use stonewise_io::table::{Table, TableError};

/// The joints as lines; their motions are empty where a stone was not measured.
pub(super) fn joint_layer(
    [name, title]: [&str; 2],
    geometry: Geometry,
    crs: Option<Crs>,
    joints: &[Joint],
    results: &ResultSet,
    line: impl Fn(&Joint) -> Vec<Point3<f64>>,
) -> Result<Layer, TableError> {
    let mut table = Table::new();
    let sides = [
        ("stone_1", "number of one stone beside the joint"),
        ("stone_2", "number of the other stone"),
    ];

    for (k, (column, meaning)) in sides.into_iter().enumerate() {
        let id = |j: &Joint| results.stones[j.stones[k]].stone_id;
        table.push(column, "", meaning, joints.iter().map(id).collect::<Vec<u32>>())?;
    }

    let widths: Vec<f64> = joints.iter().map(|j| j.width_m).collect();
    table.push(
        "width",
        "m",
        "distance between the outlines of the stones",
        widths,
    )?;
    let of = |pick: fn(&JointMotion) -> f64| -> Vec<Option<f64>> {
        joints.iter().map(|j| j.motion.as_ref().map(pick)).collect()
    };
    table.push(
        "opening",
        "m",
        "motion of the stones apart, across the joint",
        of(|m| m.opening_m),
    )?;

    table.push(
        "sliding",
        "m",
        "motion of the second stone along the joint against the first",
        of(|m| m.sliding_m),
    )?;
    table.push(
        "step_out",
        "m",
        "motion of the second stone out of the face against the first",
        of(|m| m.step_m),
    )?;
    table.push(
        "sigma_opening",
        "m",
        "standard deviation of the opening",
        of(|m| m.opening_sigma_m),
    )?;

    let significant = joints
        .iter()
        .map(|j| j.motion.as_ref().map(|m| u8::from(m.is_significant())));
    table.push(
        "significant",
        "",
        "1 where the opening differs from zero at 95 %, else 0; empty where a stone was not measured",
        significant.collect::<Vec<Option<u8>>>(),
    )?;
    let openings = joints.iter().filter_map(|j| j.motion).map(|m| m.opening_m.abs());

    Ok(Layer {
        name: name.to_owned(),
        title: title.to_owned(),
        description:
            "joints between neighbouring stones; opening across, sliding along, step out of the face, metres"
                .into(),
        geometry,
        crs,
        attributes: table,
        vertices: joints.iter().map(line).collect(),
        styles: vec![line_style(
            "Joint opening",
            "opening",
            Scale::Diverging(nice_scale_m(openings)),
        )],
    })
}
