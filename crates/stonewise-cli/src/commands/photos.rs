//! `info --unpack-photos`.

use crate::args::InfoArgs;
use crate::commands::Outcome;
use crate::counted::counted;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use stonewise::{Error, OutputFolder, Owner};
use stonewise_io::cameras::{
    E57_CAMERAS_DIR, E57_IMAGES_DIR, E57Photos, require_e57_photos, unpack_e57_photos,
};

/// Unpacks the photos that E57 files hold.
pub fn photos(args: &InfoArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let counts = require_e57_photos(&args.paths).map_err(Error::from)?;
    let owner = Owner::inputs("photos", &args.paths);
    let written = [E57_IMAGES_DIR, E57_CAMERAS_DIR, "work"];
    let folder = OutputFolder::of_inputs(&args.out, &owner, &args.paths, &written, force)?;
    for path in &counts.without {
        printer.log(&format!("note: no images in the file: {}", path.display()));
    }
    let photos = unpack_e57_photos::<Error>(&args.paths, folder.path(), printer)?;
    printer.finish();
    write!(stdout(), "{}", summary(&photos, &args.out))?;
    Ok(if photos.left_out.is_empty() {
        Outcome::Done
    } else {
        Outcome::InDoubt
    })
}

fn summary(photos: &E57Photos, out: &Path) -> String {
    let mut sizes = BTreeMap::<_, usize>::new();
    for view in &photos.views {
        *sizes.entry((view.camera.width, view.camera.height)).or_default() += 1;
    }
    let mut text = String::new();
    for ((width, height), count) in sizes {
        let _ = writeln!(text, "{} of {width} x {height} px", counted(count, "photo"));
    }
    if photos.panoramas > 0 {
        let panoramas = counted(photos.panoramas, "panorama");
        let _ = writeln!(
            text,
            "{} of them cut from {panoramas}; some programs write panoramas that are rotated relative to their pose: \
             look at the pictures of stonewise check before a run",
            4 * photos.panoramas
        );
    }
    for (reason, count) in &photos.left_out {
        let _ = writeln!(text, "left out: {} {reason}", counted(count, "image"));
    }
    if photos.masked > 0 {
        let masked = counted(photos.masked, "image");
        let _ = writeln!(text, "{masked} with a mask, which is not applied");
    }
    text.push_str("add to the epoch of these scans in a project file in this folder:\n");
    for (key, name) in [("images", E57_IMAGES_DIR), ("cameras", E57_CAMERAS_DIR)] {
        let path = out.join(name).display().to_string();
        let path = if cfg!(windows) {
            path.replace('\\', "/")
        } else {
            path
        };
        let _ = writeln!(text, "{key} = {}", toml::Value::String(path));
    }
    text
}
