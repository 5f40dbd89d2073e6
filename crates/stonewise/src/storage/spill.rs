//! Sorting more records into bins than memory holds.

use crate::error::{Error, Result};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Bytes kept in memory before bins are appended to their files.
const BUFFER_BYTES: usize = 256 << 20;

/// Bins of fixed-size records on disk: written in any order of bins, read back bin by bin in order of
/// writing.
pub struct Spill<K> {
    dir: PathBuf,
    name: fn(&K) -> String,
    bins: BTreeMap<K, Vec<u8>>,
    on_disk: BTreeSet<K>,
    buffered: usize,
}

impl<K: Ord + Clone> Spill<K> {
    /// Starts with empty bins in a fresh folder; `name` must differ between keys and fit a file system.
    pub fn new(dir: &Path, name: fn(&K) -> String) -> Result<Self> {
        if dir.exists() {
            fs::remove_dir_all(dir).map_err(Error::io("removing a left-over folder", dir))?;
        }
        fs::create_dir_all(dir).map_err(Error::io("making a folder", dir))?;
        Ok(Self {
            dir: dir.to_path_buf(),
            name,
            bins: BTreeMap::new(),
            on_disk: BTreeSet::new(),
            buffered: 0,
        })
    }

    /// Adds one or more records to a bin; says whether they are the bin's first.
    pub fn push(&mut self, bin: K, records: &[u8]) -> Result<bool> {
        let is_first = match self.bins.entry(bin) {
            Entry::Occupied(mut bytes) => {
                bytes.get_mut().extend_from_slice(records);
                false
            }
            Entry::Vacant(place) => {
                let is_first = !self.on_disk.contains(place.key());
                place.insert(records.to_vec());
                is_first
            }
        };
        self.buffered += records.len();
        if self.buffered >= BUFFER_BYTES {
            self.flush()?;
        }
        Ok(is_first)
    }

    /// Ends writing; the bins in ascending order of key.
    pub fn finish(mut self) -> Result<SpillBins<K>> {
        if !self.on_disk.is_empty() {
            self.flush()?;
        }
        let keys = self
            .bins
            .keys()
            .chain(&self.on_disk)
            .cloned()
            .collect::<BTreeSet<_>>();
        Ok(SpillBins {
            keys: keys.into_iter().collect(),
            dir: self.dir,
            name: self.name,
            memory: self.bins,
        })
    }

    fn flush(&mut self) -> Result<()> {
        for (bin, bytes) in std::mem::take(&mut self.bins) {
            let path = self.dir.join((self.name)(&bin));
            OpenOptions::new()
                .create(true)
                .append(true)
                .open(&path)
                .and_then(|mut file| file.write_all(&bytes))
                .map_err(Error::io("writing", &path))?;
            self.on_disk.insert(bin);
        }
        self.buffered = 0;
        Ok(())
    }
}

/// Finished bins; their files go when this does.
pub struct SpillBins<K> {
    keys: Vec<K>,
    dir: PathBuf,
    name: fn(&K) -> String,
    memory: BTreeMap<K, Vec<u8>>,
}

impl<K: Ord> SpillBins<K> {
    /// Keys of all bins that got a record, ascending.
    pub fn keys(&self) -> &[K] {
        &self.keys
    }

    /// All records of a bin, in order of writing.
    pub fn read(&self, bin: &K) -> Result<Vec<u8>> {
        match self.memory.get(bin) {
            Some(bytes) => Ok(bytes.clone()),
            None => {
                let path = self.dir.join((self.name)(bin));
                fs::read(&path).map_err(Error::io("reading", &path))
            }
        }
    }
}

impl<K> Drop for SpillBins<K> {
    fn drop(&mut self) {
        // Left-over bins cost disk space only; the next run removes them.
        let _ = fs::remove_dir_all(&self.dir);
    }
}
