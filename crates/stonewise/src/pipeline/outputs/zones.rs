//! Zones of deformation of all later epochs.

use crate::error::Result;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::ZonePlace;
use crate::results::names::ZONES as FILE;
use stonewise_io::table::{Table, write_parquet};

/// Writes `zones.parquet`: one row for each zone of each later epoch.
pub static ZONES: Step = Step {
    name: "zones",
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until >= Until::Registered,
    make: |run, _| write_zones(run),
    ..Step::PLAIN
};

/// A row of the table.
struct Row {
    epoch: String,
    zone_id: u32,
    place: ZonePlace,
    largest_m: f64,
    interval_m: [f64; 2],
    kind: &'static str,
}

fn write_zones(run: &Run) -> Result<()> {
    let context = run.context;
    let mut rows = Vec::new();
    for later in context.project.epochs.later_ids() {
        let (registered, measured) = (run.registered(later)?, run.measured(later)?);
        for zone in registered.deformation.iter().flat_map(|d| &d.zones) {
            let place = ZonePlace::of(zone.number, &measured.rows);
            rows.push(Row {
                epoch: context.project.epochs[later].name.clone(),
                zone_id: zone.number,
                place,
                largest_m: zone.largest_m,
                interval_m: zone.interval_m,
                kind: zone.kind.word(),
            });
        }
    }

    let reals = |of: fn(&Row) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
    let mut table = Table::new();
    let epochs: Vec<String> = rows.iter().map(|r| r.epoch.clone()).collect();
    table.push("epoch", "", "name of the later epoch", epochs)?;
    let ids: Vec<u32> = rows.iter().map(|r| r.zone_id).collect();
    table.push(
        "zone_id",
        "",
        "zone of deformation, as in the stone table of the epoch",
        ids,
    )?;
    table.push(
        "area_m2",
        "m2",
        "area of the faces of its stones",
        reals(|r| r.place.area_m2),
    )?;

    table.push(
        "along_m",
        "m",
        "middle along the unrolled wall",
        reals(|r| r.place.middle_m[0]),
    )?;
    table.push(
        "up_m",
        "m",
        "middle up the unrolled wall",
        reals(|r| r.place.middle_m[1]),
    )?;
    table.push(
        "largest_m",
        "m",
        "largest deformation of a stone",
        reals(|r| r.largest_m),
    )?;

    table.push(
        "lower_m",
        "m",
        "lower end of its 95 % interval",
        reals(|r| r.interval_m[0]),
    )?;
    table.push(
        "upper_m",
        "m",
        "upper end of its 95 % interval",
        reals(|r| r.interval_m[1]),
    )?;
    let kinds: Vec<String> = rows.iter().map(|r| r.kind.to_owned()).collect();
    table.push(
        "kind",
        "",
        "what it resembles: bulge, dent, tilt, settlement, heave, slide or distortion",
        kinds,
    )?;

    Ok(write_parquet(&context.out.join(FILE), &table)?)
}
