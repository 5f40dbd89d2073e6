//! Compressed points come back as they were written by the encoder of another crate.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use las::{Builder, PointDataBuilder, Reader, Vlr, point::Format};
use laz::encoders::ArithmeticEncoder;
use laz::las::v2::LasPoint0Compressor;
use laz::las::{Point1, Point3, Point6, Point7, Point8};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::{FieldCompressor, RecordCompressor, SequentialPointRecordCompressor};
use laz::{LazItem, LazItemRecordBuilder, LazItemType, LazVlr, LazVlrBuilder, ParLasZipCompressor};
use stonewise_io::cloud::{CloudError, read_cloud, select_points};

const POINTS: usize = 3000;
/// Points in chunks of one point.
const FEW: usize = 100;
/// Several chunks, the last of which is not full.
const CHUNK: u32 = 700;

/// More than are unpacked at once.
const LARGE_CHUNK: u32 = 3_000_000;

/// Pseudo-random numbers that are the same in every run (Knuth 1981, linear congruence modulo 2^64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }
}

/// How a file is packed.
struct Case {
    name: &'static str,
    format: u8,
    extra_bytes: u16,
    items: Vec<LazItem>,
    /// Flags of the class have a byte of their own, as from format 6 on.
    is_extended: bool,
}

fn cases() -> Vec<Case> {
    let case = |name, format, extra_bytes, items| Case {
        name,
        format,
        extra_bytes,
        items,
        is_extended: format >= 6,
    };
    vec![
        case("1 v1", 1, 0, LazItemRecordBuilder::version_1_of::<Point1>(0)),
        case("1 v2", 1, 0, LazItemRecordBuilder::version_2_of::<Point1>(0)),
        case("3 v2", 3, 2, LazItemRecordBuilder::version_2_of::<Point3>(2)),
        case("6 v3", 6, 0, LazItemRecordBuilder::version_3_of::<Point6>(0)),
        case("7 v3", 7, 3, LazItemRecordBuilder::version_3_of::<Point7>(3)),
        case("8 v3", 8, 0, LazItemRecordBuilder::version_3_of::<Point8>(0)),
        case("8 v4", 8, 2, LazItemRecordBuilder::version_4_of::<Point8>(2)),
    ]
}

/// Records whose attributes sometimes stay, sometimes step and sometimes jump.
fn records(case: &Case) -> Vec<u8> {
    let length = usize::from(format(case).len());
    let time_at = if case.is_extended { 22 } else { 20 };
    let mut random = Random(u64::from(case.format) * 97 + u64::from(case.items[0].version()));
    let mut record = vec![0; length];
    let mut sequences = [1e5, 2e5, 3e5, 4e5, 5e5];
    let mut all = Vec::new();
    for _ in 0..POINTS {
        for at in (0..length).filter(|at| !(time_at..time_at + 8).contains(at)) {
            let is_coordinate = at < 12;
            match random.below(if is_coordinate { 12 } else { 24 }) {
                0 => record[at] = random.next() as u8,
                // The high bytes of coordinates change less often.
                1..4 if !is_coordinate || at % 4 < 2 => record[at] = record[at].wrapping_add(1),
                _ => {}
            }
        }
        let time = next_time(&mut sequences, &mut random);
        if let Some(time) = time {
            record[time_at..time_at + 8].copy_from_slice(&f64::to_le_bytes(time));
        }
        all.extend_from_slice(&record);
    }
    all
}

/// The time of the next point, where it is not that of the last.
fn next_time(sequences: &mut [f64; 5], random: &mut Random) -> Option<f64> {
    let which = random.below(40) as usize;
    let sequence = &mut sequences[which.saturating_sub(35)];
    // Times are packed as the whole numbers that their bits are.
    let steps = match random.below(20) {
        0..6 => return None,
        6..14 => 1000,
        14 => random.below(8) as i64 * 1000,
        15 => -(random.below(20) as i64) * 1000,
        16 => random.below(700) as i64 * 1000 + random.below(3) as i64,
        17 => random.next() as i64,
        18 => 0,
        _ => (random.next() as i64) << 20,
    };
    *sequence = f64::from_bits(sequence.to_bits().wrapping_add_signed(steps));
    Some(*sequence)
}

fn format(case: &Case) -> Format {
    let mut format = Format::new(case.format).unwrap();
    format.extra_bytes = case.extra_bytes;
    format.is_compressed = true;
    format
}

fn write(path: &Path, case: &Case, chunk: Option<u32>, records: &[u8]) {
    let vlr = match chunk {
        Some(points) => LazVlrBuilder::new(case.items.clone())
            .with_fixed_chunk_size(points)
            .build(),
        None => LazVlrBuilder::new(case.items.clone())
            .with_variable_chunk_size()
            .build(),
    };
    let mut builder = Builder::from((1, 4));
    builder.point_format = format(case);
    let mut data = Vec::new();
    vlr.write_to(&mut data).unwrap();
    builder.vlrs.push(Vlr {
        user_id: LazVlr::USER_ID.to_owned(),
        record_id: LazVlr::RECORD_ID,
        description: String::new(),
        data,
    });
    let mut header = builder.into_header().unwrap();
    let points = PointDataBuilder::new().for_header(&header);
    header.add_point_data(&points.build_from_bytes(records.to_vec()).unwrap());
    let mut file = BufWriter::new(File::create(path).unwrap());
    header.write_to(&mut file).unwrap();
    let mut compressor = ParLasZipCompressor::new(file, vlr).unwrap();
    if chunk.is_some() {
        compressor.compress_many(records).unwrap();
    } else {
        let length = usize::from(header.point_format().len());
        let (first, second) = records.split_at(length * 1111);
        compressor.compress_chunks([first, &[], second]).unwrap();
    }
    compressor.done().unwrap();
}

#[test]
fn points_of_every_kind_come_back_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let (path, copy) = (folder.path().join("a.laz"), folder.path().join("b.laz"));
    for case in cases() {
        let all = records(&case);
        let few = &all[..FEW * usize::from(format(&case).len())];
        let packings = [
            (Some(CHUNK), &all[..]),
            (Some(LARGE_CHUNK), &all),
            (None, &all),
            (Some(1), few),
        ];
        for (chunk, records) in packings {
            write(&path, &case, chunk, records);
            let copied = select_points(&path, &copy, |_| Ok::<_, CloudError>(true)).unwrap();
            let data = Reader::from_path(&copy).unwrap().read_all().unwrap();
            let length = data.record_len();
            assert_eq!(copied.records, (records.len() / length) as u64);
            assert_eq!(data.raw_bytes().len(), records.len());
            let wrong = data
                .raw_bytes()
                .chunks(length)
                .zip(records.chunks(length))
                .position(|(a, b)| a != b);
            assert_eq!(wrong, None, "{} {chunk:?}", case.name);
        }
    }
}

#[test]
fn the_number_of_points_at_a_time_does_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    for case in cases() {
        write(&path, &case, Some(CHUNK), &records(&case));
        let read = |step| {
            let mut all = Vec::new();
            read_cloud(&path, step, |chunk| {
                let times = chunk.times_s.iter().flatten().map(|t| t.to_bits());
                all.extend(chunk.positions.iter().zip(times).map(|(p, t)| (*p, t)));
                Ok::<(), CloudError>(())
            })
            .unwrap();
            all
        };
        let whole = read(POINTS);
        // The others are withheld or noise.
        assert!(whole.len() > POINTS / 4);
        for step in [699, 700, 701, 1, 1999] {
            assert!(read(step) == whole, "{}: {step} points at a time", case.name);
        }
    }
}

/// Message that refuses a file with damaged times in its first chunk.
fn assert_refused(path: &Path, name: &str) {
    let refused = read_cloud(path, POINTS, |_| Ok::<(), CloudError>(()));
    let expected = format!(
        "{}: chunk 1: the GPS times of its points are damaged: copy the file again, or write it again",
        path.display()
    );
    assert_eq!(refused.unwrap_err().to_string(), expected, "{name}");
}

#[test]
fn damaged_layers_of_times_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    for case in cases().into_iter().filter(|case| case.is_extended) {
        write(&path, &case, Some(CHUNK), &records(&case));
        let mut bytes = std::fs::read(&path).unwrap();
        let word = |at| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        // After the place of the table, the first point and the number of the others.
        let sizes = word(96) + 8 + usize::from(format(&case).len()) + 4;
        let others: usize = case.items[1..].iter().map(layers).sum();
        let layers: Vec<usize> = (0..9).map(|i| word(sizes + 4 * i)).collect();
        let end = sizes + 4 * (9 + others) + layers.iter().sum::<usize>();
        // Bytes of ones decode to the last symbol of every model: a switch to another sequence of times.
        bytes[end - layers[8]..end].fill(255);
        std::fs::write(&path, &bytes).unwrap();
        assert_refused(&path, case.name);
    }
}

/// Layers of an item other than the positions and times.
fn layers(item: &LazItem) -> usize {
    match item.item_type() {
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => usize::from(count),
        _ => 1,
    }
}

/// Packs switches between the sequences of times, and no time.
struct Switches(ArithmeticModel);

impl<W: Write> FieldCompressor<W> for Switches {
    fn size_of_field(&self) -> usize {
        8
    }

    fn compress_first(&mut self, destination: &mut W, time: &[u8]) -> std::io::Result<()> {
        destination.write_all(time)
    }

    fn compress_with(&mut self, encoder: &mut ArithmeticEncoder<W>, _: &[u8]) -> std::io::Result<()> {
        // Each took about 100 bytes of stack, of which the largest threads have 8 MiB.
        (0..400_000).try_for_each(|_| encoder.encode_symbol(&mut self.0, 5))
    }
}

#[test]
fn damaged_times_without_layers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let case = cases().swap_remove(1);
    let records = records(&case);
    write(&path, &case, Some(CHUNK), &records);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes.truncate(u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize);
    let no_table = [255; 8];
    bytes.extend(no_table);

    let mut chunk = SequentialPointRecordCompressor::new(Vec::new());
    chunk.add_field_compressor(LasPoint0Compressor::default());
    chunk.add_field_compressor(Switches(ArithmeticModelBuilder::new(6).build()));
    chunk.compress_many(&records[..2 * 28]).unwrap();
    chunk.done().unwrap();
    bytes.extend(chunk.into_inner());
    bytes.extend(no_table);
    std::fs::write(&path, &bytes).unwrap();
    assert_refused(&path, case.name);
}
