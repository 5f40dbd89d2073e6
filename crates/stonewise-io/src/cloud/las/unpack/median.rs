//! The running median that predicts coordinates (LASzip: `StreamingMedian5`).

/// Five values; each new one replaces the largest or the smallest.
#[derive(Clone, Copy)]
pub struct Median {
    /// In rising order.
    values: [i32; 5],
    pushes_largest: bool,
}

impl Median {
    pub const fn new() -> Self {
        Self {
            values: [0; 5],
            pushes_largest: true,
        }
    }

    pub fn get(&self) -> i32 {
        self.values[2]
    }

    pub fn add(&mut self, value: i32) {
        let median = self.get();
        if self.pushes_largest {
            self.pushes_largest = value < median;
            self.values[4] = value;
            for i in (0..4).rev() {
                if self.values[i] <= value {
                    break;
                }
                self.values.swap(i, i + 1);
            }
        } else {
            self.pushes_largest = value <= median;
            self.values[0] = value;
            for i in 1..5 {
                if self.values[i] >= value {
                    break;
                }
                self.values.swap(i - 1, i);
            }
        }
    }
}
