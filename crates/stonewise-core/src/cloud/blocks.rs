//! Cells of a grid of which few are occupied.

use std::ops::Range;

/// A range of cells along each axis, ends included.
pub(super) type CellBox = [(usize, usize); 3];

/// Cells along the edge of a block; one bit of a mask stands for each of its 64 cells.
const EDGE: usize = 4;
/// More blocks than this are never made: their table takes 120 MB.
const MAX_BLOCKS: f64 = 3e7;
/// In the table: a block without points.
const EMPTY: u32 = u32::MAX;

/// Which items lie in which cell, sorted by block, cell in the block, and item.
///
/// A surface fills few cells of its box: only occupied blocks have an entry, and in it only occupied cells.
pub(super) struct Blocks {
    /// Number of blocks along each axis.
    dims: [usize; 3],
    /// Entry of each block in `entries`, x fastest.
    table: Vec<u32>,
    entries: Vec<Entry>,
    /// Start of each occupied cell in the sorted items; one more entry than cells.
    starts: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Entry {
    /// The occupied cells, x fastest.
    cells: u64,
    /// Place of its first cell in `starts`.
    first: u32,
}

impl Blocks {
    /// Whether a grid of this many cells is small enough.
    pub(super) fn can_hold(cells: [f64; 3]) -> bool {
        cells.iter().map(|c| (c / EDGE as f64).ceil()).product::<f64>() <= MAX_BLOCKS
    }

    /// Sorts items by their cells; the items in their new order.
    pub(super) fn sort(cell_dims: [usize; 3], cells: impl Iterator<Item = [usize; 3]>) -> (Self, Vec<u32>) {
        let mut blocks = Self {
            dims: cell_dims.map(|d| d.div_ceil(EDGE)),
            table: Vec::new(),
            entries: Vec::new(),
            starts: Vec::new(),
        };
        let places: Vec<(u32, u8)> = cells.map(|c| (blocks.place_of(&c) as u32, bit_of(&c))).collect();
        let mut next = vec![0u32; blocks.dims.iter().product::<usize>() + 1];
        for (place, _) in &places {
            next[*place as usize + 1] += 1;
        }
        for i in 1..next.len() {
            next[i] += next[i - 1];
        }

        let mut sorted = vec![0u64; places.len()];
        for (i, (place, bit)) in places.iter().enumerate() {
            let slot = &mut next[*place as usize];
            sorted[*slot as usize] = u64::from(*bit) << 32 | i as u64;
            *slot += 1;
        }

        drop(places);
        // `next` now holds where each block ends.
        let mut start = 0;
        blocks.table = next;
        blocks.table.pop();

        for entry in &mut blocks.table {
            let end = std::mem::replace(entry, EMPTY) as usize;
            if end > start {
                *entry = blocks.entries.len() as u32;
                blocks
                    .entries
                    .push(add_cells(&mut sorted[start..end], start, &mut blocks.starts));
            }
            start = end;
        }

        blocks.starts.push(sorted.len() as u32);
        (blocks, sorted.into_iter().map(|key| key as u32).collect())
    }

    /// Place of a cell's block in the table.
    #[inline]
    pub(super) fn place_of(&self, cell: &[usize; 3]) -> usize {
        let [i, j, k] = cell.map(|c| c / EDGE);
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// Calls `visit` with the items of a box of cells, run by run in ascending order of cell (z, then y, then
    /// x).
    #[inline]
    pub(super) fn for_each_run(&self, cells: &CellBox, mut visit: impl FnMut(Range<usize>)) {
        let (from, to) = (cells[0].0 / EDGE, cells[0].1 / EDGE);
        for k in cells[2].0..=cells[2].1 {
            for j in cells[1].0..=cells[1].1 {
                let row = self.place_of(&[0, j, k]);
                let at = (k % EDGE * EDGE + j % EDGE) * EDGE;
                for block in from..=to {
                    let entry = self.table[row + block];
                    if entry != EMPTY {
                        let wanted = span(&cells[0], block) << at;
                        let entry = self.entries[entry as usize];
                        if entry.cells & wanted != 0 {
                            visit(self.run(&entry, wanted));
                        }
                    }
                }
            }
        }
    }

    /// Calls `test` with the items of a box of cells, run by run and block by block, until one is true.
    #[inline]
    pub(super) fn any_run(&self, cells: &CellBox, mut test: impl FnMut(Range<usize>) -> bool) -> bool {
        let [from, to] = [cells.map(|c| c.0 / EDGE), cells.map(|c| c.1 / EDGE)];
        for k in from[2]..=to[2] {
            let layers = each_as(span(&cells[2], k), 16, 0x0001_0001_0001_0001) * 0xffff;
            for j in from[1]..=to[1] {
                let rows = each_as(span(&cells[1], j), 4, 0x1111) * 0xf;
                let rows = layers & (rows * 0x0001_0001_0001_0001);
                let place = (k * self.dims[1] + j) * self.dims[0];
                for i in from[0]..=to[0] {
                    let entry = self.table[place + i];
                    if entry == EMPTY {
                        continue;
                    }
                    let entry = self.entries[entry as usize];
                    let mut left = entry.cells & rows & (span(&cells[0], i) * 0x1111_1111_1111_1111);
                    while left != 0 {
                        let lowest = left.trailing_zeros();
                        let length = (left >> lowest).trailing_ones();
                        let run = (u64::MAX >> (64 - length)) << lowest;
                        if test(self.run(&entry, run)) {
                            return true;
                        }
                        left &= !run;
                    }
                }
            }
        }
        false
    }

    /// Number of occupied cells.
    pub(super) fn occupied(&self) -> usize {
        self.starts.len() - 1
    }

    /// Items of an occupied cell.
    pub(super) fn items(&self, occupied: usize) -> Range<usize> {
        self.starts[occupied] as usize..self.starts[occupied + 1] as usize
    }

    /// Items of the cell that holds a sorted item.
    pub(super) fn cell_around(&self, item: usize) -> Range<usize> {
        let after = self.starts.partition_point(|&start| start as usize <= item);
        self.items(after - 1)
    }

    /// Calls `visit` with the number and the place of every occupied cell of a box, block by block.
    #[inline]
    pub(super) fn for_each_cell(&self, cells: &CellBox, mut visit: impl FnMut(usize, [usize; 3])) {
        let [from, to] = [cells.map(|c| c.0 / EDGE), cells.map(|c| c.1 / EDGE)];
        for k in from[2]..=to[2] {
            for j in from[1]..=to[1] {
                for i in from[0]..=to[0] {
                    let entry = self.table[(k * self.dims[1] + j) * self.dims[0] + i];
                    if entry == EMPTY {
                        continue;
                    }
                    let entry = self.entries[entry as usize];
                    let (mut left, mut number) = (entry.cells, entry.first as usize);
                    while left != 0 {
                        let bit = left.trailing_zeros() as usize;
                        let inside = [bit % EDGE, bit / EDGE % EDGE, bit / EDGE / EDGE];
                        let cell = [i * EDGE + inside[0], j * EDGE + inside[1], k * EDGE + inside[2]];
                        if (0..3).all(|a| cells[a].0 <= cell[a] && cell[a] <= cells[a].1) {
                            visit(number, cell);
                        }
                        left &= left - 1;
                        number += 1;
                    }
                }
            }
        }
    }

    /// Items of the occupied cells among `wanted`, which are consecutive bits.
    #[inline]
    fn run(&self, entry: &Entry, wanted: u64) -> Range<usize> {
        let before = (1u64 << wanted.trailing_zeros()) - 1;
        let first = entry.first + (entry.cells & before).count_ones();
        let last = first + (entry.cells & wanted).count_ones();
        self.starts[first as usize] as usize..self.starts[last as usize] as usize
    }
}

/// Sorts the items of a block, which begin at `start`, and notes where its cells begin.
fn add_cells(items: &mut [u64], start: usize, starts: &mut Vec<u32>) -> Entry {
    items.sort_unstable();
    let first = starts.len() as u32;
    let mut cells = 0;
    for (i, item) in items.iter().enumerate() {
        let cell = 1u64 << (item >> 32);
        if cells & cell == 0 {
            cells |= cell;
            starts.push((start + i) as u32);
        }
    }
    Entry { cells, first }
}

/// Bit of a cell in its block.
#[inline]
fn bit_of(cell: &[usize; 3]) -> u8 {
    let [i, j, k] = cell.map(|c| c % EDGE);
    ((k * EDGE + j) * EDGE + i) as u8
}

/// The cells of a block along one axis that lie in a range of cells, as four bits.
#[inline]
fn span(cells: &(usize, usize), block: usize) -> u64 {
    let low = cells.0.saturating_sub(EDGE * block).min(EDGE - 1);
    let high = (cells.1 - EDGE * block).min(EDGE - 1);
    (0xf >> (EDGE - 1 - high)) & (0xf << low)
}

/// Four bits, moved to every `width`-th bit; `places` has those bits set.
#[inline]
fn each_as(bits: u64, width: u32, places: u64) -> u64 {
    let step = width - 1;
    (bits | bits << step | bits << (2 * step) | bits << (3 * step)) & places
}
