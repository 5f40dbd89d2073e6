//! Every reader, with the files that it is tried on.

use super::campaign::{Campaign, SameInputs};
use super::edit::Input;
use super::readers;
use super::seeds::{PROJECT, PROJECT_FILES, Seed, testdata, text, written};
use std::fs;
use std::path::Path;
use stonewise_core::raster::Raster;
use stonewise_io::crs::Crs;
use stonewise_io::image_io::{write_jpeg, write_png_rgb};
use stonewise_io::masks::write_label_png;

/// A reader.
pub struct Target {
    pub read: fn(&Path) -> Result<(), String>,
    seeds: Vec<Seed>,
    /// Makes checksums right, so that what lies behind them is reached.
    repair: Option<fn(&mut [u8])>,
    /// Sound files that lie beside the input.
    beside: Vec<Seed>,
}

impl Target {
    fn new(read: fn(&Path) -> Result<(), String>, seeds: Vec<Seed>) -> Self {
        Self {
            read,
            seeds,
            repair: None,
            beside: Vec::new(),
        }
    }

    fn repaired(self, repair: fn(&mut [u8])) -> Self {
        Self {
            repair: Some(repair),
            ..self
        }
    }

    fn beside(self, beside: Vec<Seed>) -> Self {
        Self { beside, ..self }
    }

    /// Writes the files that lie beside the inputs.
    pub fn prepare(&self, home: &Path) {
        for seed in &self.beside {
            fs::write(home.join(&seed.name), &seed.bytes).unwrap();
        }
        fs::create_dir_all(home.join("images")).unwrap();
    }

    /// The name and the bytes of a changed seed.
    pub fn bytes_of(&self, input: &Input) -> (String, Vec<u8>) {
        let [seed, other] = [input.seed, input.other].map(|n| &self.seeds[usize::from(n) % self.seeds.len()]);
        let mut bytes = seed.bytes.clone();
        for edit in &input.edits {
            edit.apply(&mut bytes, &other.bytes);
        }
        if let Some(repair) = self.repair.filter(|_| !input.is_damage) {
            repair(&mut bytes);
        }
        (seed.name.clone(), bytes)
    }
}

macro_rules! targets {
    ($($name:ident: $target:expr,)*) => {
        $(
            #[test]
            fn $name() {
                let campaign = Campaign::new(stringify!($name), $target);
                if cfg!(fuzzing) {
                    bolero::check!().with_type().for_each(|input| campaign.try_input(input));
                } else {
                    let target = bolero::TestTarget::new(SameInputs);
                    target.with_type().for_each(|input| campaign.try_input(input));
                }
                campaign.end();
            }
        )*
    };
}

targets! {
    las: Target::new(readers::las, testdata(&[
        "clouds/las10_format1.las",
        "clouds/las11_format0.las",
        "clouds/las12_format3.las",
        "clouds/las13_format1.laz",
        "clouds/las14_format8.las",
        "hostile/las_2e60.las",
    ])),
    laz: Target::new(readers::las, testdata(&[
        "clouds/las12_format2.laz",
        "clouds/las14_format6.laz",
        "clouds/las14_format7_extra.laz",
        "hostile/layer_sizes.laz",
        "hostile/laz_2e60.laz",
    ])),
    copc: Target::new(readers::las, testdata(&["clouds/chunks.copc.laz"])),
    e57: Target::new(readers::las, testdata(&["clouds/two_scans.e57"])).repaired(page_checksums),
    ply: Target::new(readers::ply, testdata(&["clouds/little.ply", "clouds/big.ply"])),
    ply_text: Target::new(readers::ply, ply_texts()),
    ptx: Target::new(readers::las, testdata(&["clouds/two_scans.ptx"])),
    xyz: Target::new(readers::cloud, testdata(&[
        "clouds/plain.xyz",
        "clouds/tabs.txt",
        "clouds/header.csv",
        "clouds/german.csv",
        "clouds/count.pts",
    ])),
    metashape: Target::new(readers::map_cameras, metashape_files()),
    colmap_text: Target::new(readers::cameras, testdata(&["cameras/colmap_txt/images.txt"]))
        .beside(testdata(&["cameras/colmap_txt/cameras.txt"])),
    pix4d: Target::new(readers::cameras, testdata(&[
        "cameras/pix4d/dam_calibrated_camera_parameters.txt",
    ])),
    realitycapture: Target::new(readers::cameras, testdata(&[
        "cameras/realitycapture/cameras.csv",
        "cameras/realitycapture/opencv.csv",
        "cameras/realitycapture/xmp/brown3t2.xmp",
    ]))
    .beside(vec![photo_named("none.jpg"), photo_named("brown3t2.jpg")]),
    colmap: Target::new(readers::cameras, colmap_files()).beside(colmap_files()),
    opensfm: Target::new(readers::cameras, testdata(&["cameras/opensfm.json"])),
    geoid: Target::new(readers::geoid, testdata(&[
        "crs/geoid.gtx",
        "crs/geoid_area.tif",
        "crs/geoid_point.tif",
    ])),
    coco: Target::new(readers::coco, vec![text("masks.json", MASKS)]),
    regions: Target::new(readers::regions, vec![text("regions.json", REGIONS)]),
    labels: Target::new(readers::labels, label_images()),
    photos: Target::new(readers::photo, photo_files()),
    project: Target::new(readers::project, vec![text("stonewise.toml", PROJECT)])
        .beside(PROJECT_FILES.map(|name| text(name, "")).into()),
    init: Target::new(readers::init, folder_plans()),
}

/// See `init`: two epochs with clouds and photos, and files without folders.
fn folder_plans() -> Vec<Seed> {
    ["Pe@QgRx@PRx", "abcdefghijklmnopqrstuvwxyz"]
        .map(|plan| text("folders.txt", plan))
        .into()
}

/// Polygons, and runs as numbers and as text: 40 pixels, then 20 of the mask, then 140.
const MASKS: &str = r#"{"images": [{"id": 1, "file_name": "images/0001.jpg", "width": 20, "height": 10}],
 "categories": [{"id": 1, "name": "stone"}], "annotations": [
 {"id": 1, "image_id": 1, "category_id": 1, "segmentation": [[0, 0, 9, 0, 9, 8, 0, 8], [12, 1, 15, 1, 15, 4]]},
 {"id": 2, "image_id": 1, "category_id": 1, "iscrowd": 1, "segmentation": {"size": [10, 20], "counts": [40, 20, 140]}},
 {"id": 3, "image_id": 1, "category_id": 1, "segmentation": {"size": [10, 20], "counts": "X1d0\\4"}}]}"#;

const REGIONS: &str = r#"{"images/0001.jpg": {"width": 64, "height": 48, "valid": [
 {"outer": [0, 0, 60, 0, 60, 40, 0, 40], "holes": [[2, 2, 9, 2, 9, 9]]}]}}"#;

fn colmap_files() -> Vec<Seed> {
    testdata(&["cameras/colmap_bin/cameras.bin", "cameras/colmap_bin/images.bin"])
}

fn ply_texts() -> Vec<Seed> {
    let mut seeds = testdata(&[
        "clouds/text.ply",
        "hostile/ply_element_without_properties.ply",
        "hostile/ply_huge_element_at_eof.ply",
    ]);
    let mesh = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element face 2\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0\n1 0 0\n1 2 0\n0 2 0.5\n4 0 1 2 3\n3 3 1 0\n";
    seeds.push(text("mesh.ply", mesh));
    seeds
}

fn metashape_files() -> Vec<Seed> {
    let mut seeds = testdata(&["cameras/metashape.xml", "hostile/bomb.xml", "hostile/xxe.xml"]);
    // Earth-centred poses, near Bonn.
    let camera = "<camera id=\"0\" sensor_id=\"0\" label=\"one.jpg\"><transform>1 0 0 3980000 0 1 0 498000 0 0 1 4944000 \
                  0 0 0 1</transform></camera>";
    let crs = Crs::parse("EPSG:25832").unwrap().wkt.replace('"', "&quot;");
    let chunk = format!(
        "<document><chunk label=\"a\"><sensors><sensor id=\"0\" type=\"frame\"><resolution width=\"40\" height=\"30\"/>\
         <calibration type=\"frame\" class=\"adjusted\"><f>30</f></calibration></sensor></sensors>\
         <cameras>{camera}</cameras><reference>{crs}</reference></chunk></document>"
    );
    seeds.push(text("earth.xml", &chunk));
    seeds
}

fn label_images() -> Vec<Seed> {
    let values = (0..64 * 48).map(|i| (i % 64) / 9 * 40).collect();
    let labels = Raster::from_vec(64, 48, values).unwrap();
    let mut seeds = testdata(&["hostile/claim.png"]);
    seeds.push(written("photo.png", |path| {
        write_label_png(path, &labels).unwrap()
    }));
    seeds
}

fn photo_named(name: &str) -> Seed {
    let picture = Raster::filled(40, 30, [99; 3]);
    written(name, |path| write_jpeg(path, &picture, 90).unwrap())
}

fn photo_files() -> Vec<Seed> {
    let pixels = (0..64 * 48).map(|i| [i as u8, (i / 64) as u8, 99]).collect();
    let picture = Raster::from_vec(64, 48, pixels).unwrap();
    let mut seeds = testdata(&["hostile/lie.jpg"]);
    seeds.push(written("photo.jpg", |path| {
        write_jpeg(path, &picture, 90).unwrap()
    }));
    seeds.push(written("photo.png", |path| {
        write_png_rgb(path, &picture).unwrap()
    }));
    seeds
}

/// E57: a CRC-32C at the end of every page, big endian (ASTM E2807, section 9.3).
fn page_checksums(bytes: &mut [u8]) {
    let Some(size) = bytes.get(40..48).and_then(|b| b.try_into().ok()) else {
        return;
    };
    let size = usize::try_from(u64::from_le_bytes(size)).unwrap_or(0);
    if !(8..=1 << 20).contains(&size) {
        return;
    }
    for page in bytes.chunks_exact_mut(size) {
        let (data, checksum) = page.split_at_mut(size - 4);
        // Castagnoli's polynomial, bit by bit.
        let of_bit = |c: u32| c >> 1 ^ (0x82f6_3b78 & (c & 1).wrapping_neg());
        let crc = !data.iter().fold(!0, |crc: u32, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| of_bit(c))
        });
        checksum.copy_from_slice(&crc.to_be_bytes());
    }
}
