//! The page of the experiment and its files.

use super::case::{Method, file_name};
use super::figures;
use super::outcome::Outcome;
use super::tables::{PARAMETER_HEAD, PaperTables, RMSE_HEAD, SEGMENTATION_HEAD};
use crate::error::{Error, Result};
use crate::figure::{Page, Plot, jpeg_element, table};
use crate::files::write_text;
use std::fs;
use std::path::Path;
use stonewise_io::table::write_csv;

/// What `table2.csv` as a whole holds.
const TABLE2: &str = "One row per method, survey, motion and region.";

/// What `segmentation.csv` as a whole holds.
const SEGMENTATION: &str =
    "One row per detector and set of labelled photos: figures on the stones held out of training.";

/// Writes everything that the experiment came to.
pub(super) fn write(all: &Outcome, tables: &PaperTables, out: &Path) -> Result<()> {
    write_text(&out.join("tables.md"), &tables.markdown())?;
    write_csv(&out.join("table2.csv"), &tables.csv()?, TABLE2, None)?;
    if !tables.segmentation.is_empty() {
        write_csv(
            &out.join("segmentation.csv"),
            &tables.segmentation_csv()?,
            SEGMENTATION,
            None,
        )?;
    }
    let folder = out.join("figures");
    fs::create_dir_all(&folder).map_err(Error::io("making a folder", &folder))?;
    let mut page = Page::new("The paper's experiment");
    page.note(
        "One epoch is split at random into two halves of its points and photos; each half is labelled on its own; the points \
         of the second are then moved by a known field, and everything is measured as between two epochs. In-plane figures are \
         per axis, as the paper's.",
    );
    for origin in &all.origins {
        page.note(&format!(
            "{}: in all tables and figures the stones are {}.",
            origin.survey, origin.words
        ));
    }
    page.heading("Table 1: parameters")
        .html(&table(&PARAMETER_HEAD, &tables.parameters, None));
    page.heading("Table 2: RMSE of detected and applied motions")
        .html(&table(&RMSE_HEAD, &tables.rmse, None));
    page.note(
        "In-plane: the translation of 2 cm along and 5 cm up. Out-of-plane: the bulge, over all stones of the wall, still ones \
         too; the rows \"inside it\" below count only the place that moves. The zero predictor always answers \"did not move\".",
    );
    page.html(&table(PaperTables::detail_head(), &tables.detail_rows(), None));
    if !tables.segmentation.is_empty() {
        page.heading("Segmentation: stones held out of the training")
            .html(&table(&SEGMENTATION_HEAD, &tables.segmentation_rows(), None));
        page.note(
            "A tenth of each labelled photo, in blocks, is held out of the training. All detectors but the paper's network are \
             measured on the stones of these blocks alone; they are given whole photos, without relief. A detected stone is \
             correct if its IoU with a true one is at least 0.5; mean IoU is the mean over the correct stones.",
        );
    }
    if let Some(example) = &all.example {
        let caption = format!(
            "Figure 5: stones in {} ({} instances), {}",
            example.photo, example.instances, example.origin
        );
        page.heading("Figures")
            .figure(&caption, &jpeg_element(&example.jpeg, &caption));
    }
    let mut draw = |name: &str, caption: &str, plot: &Plot| -> Result<()> {
        let svg = plot.svg();
        write_text(&folder.join(format!("{name}.svg")), &svg)?;
        page.figure(caption, &svg);
        Ok(())
    };
    for case in &all.cases {
        let key = file_name(&format!("{}-{}", case.survey, case.method.folder()));
        let key = key.to_string_lossy();
        let who = format!("{}, {}", case.survey, case.method.name());
        if case.motion.region.is_none() {
            let title = format!("{who}: displacement of every stone, grey without a match (mm)");
            draw(
                &format!("figure_6-{key}"),
                "Figure 6: translation",
                &figures::stone_map(case, &title),
            )?;
            let [stones, m3c2] = figures::translation_scatter(case);
            draw(
                &format!("figure_7a-{key}"),
                &format!("Figure 7: translation, {who}"),
                &stones,
            )?;
            if case.method == Method::Ours {
                draw(
                    &format!("figure_7b-{key}"),
                    &format!("Figure 7: translation, {who}"),
                    &m3c2,
                )?;
            }
            continue;
        }
        let title = format!("{who}: displacement of every stone, grey without a match (mm)");
        draw(
            &format!("figure_8-{key}"),
            "Figure 8: bulge",
            &figures::stone_map(case, &title),
        )?;
        if let Some([stones, m3c2]) = figures::bulge_maps(case) {
            draw(
                &format!("figure_9a-{key}"),
                &format!("Figure 9: bulge, {who}"),
                &stones,
            )?;
            if case.method == Method::Ours {
                draw(
                    &format!("figure_9b-{key}"),
                    &format!("Figure 9: bulge, {who}"),
                    &m3c2,
                )?;
            }
        }
        if let Some(profile) = figures::bulge_profile(case) {
            draw(
                &format!("figure_9c-{key}"),
                &format!("Figure 9: profile, {who}"),
                &profile,
            )?;
        }
    }
    write_text(&out.join("index.html"), &page.finish())
}
