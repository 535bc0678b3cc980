//! Uncompressed TIFF files, written tag by tag.

/// One tag of a page: number, type (3: 16 bits, 4: 32 bits, 7: bytes) and values.
pub struct Tag {
    pub number: u16,
    pub kind: u16,
    pub values: Vec<u32>,
}

/// One picture of a file.
pub struct Page {
    pub size: [u32; 2],
    /// Channels of a pixel.
    pub channels: u16,
    /// Samples, row by row, as numbers of `bits` bits.
    pub samples: Vec<u16>,
    pub bits: u16,
    /// Further tags. One that every page has is replaced.
    pub tags: Vec<Tag>,
}

impl Page {
    /// A page of an 8-bit RGB image.
    pub fn rgb(image: &image::RgbImage) -> Self {
        let samples = image.as_raw().iter().map(|sample| u16::from(*sample));
        Self {
            size: [image.width(), image.height()],
            channels: 3,
            samples: samples.collect(),
            bits: 8,
            tags: Vec::new(),
        }
    }

    /// The same page with a tag of one 16-bit number.
    pub fn with(mut self, number: u16, value: u32) -> Self {
        self.tags.push(Tag { number, kind: 3, values: vec![value] });
        self
    }

    /// The same page with an ICC profile.
    pub fn with_profile(mut self, profile: &[u8]) -> Self {
        self.tags.push(Tag { number: 34675, kind: 7, values: profile.iter().map(|byte| u32::from(*byte)).collect() });
        self
    }

    fn all_tags(&self, samples_at: u32) -> Vec<Tag> {
        let bytes = self.samples.len() as u32 * u32::from(self.bits) / 8;
        let photometric = if self.channels < 3 { 1 } else { 2 };
        let mut tags: Vec<Tag> = [
            (256, 4, vec![self.size[0]]),
            (257, 4, vec![self.size[1]]),
            (258, 3, vec![u32::from(self.bits); usize::from(self.channels)]),
            (259, 3, vec![1]),
            (262, 3, vec![photometric]),
            (273, 4, vec![samples_at]),
            (277, 3, vec![u32::from(self.channels)]),
            (278, 4, vec![self.size[1]]),
            (279, 4, vec![bytes]),
        ]
        .into_iter()
        .map(|(number, kind, values)| Tag { number, kind, values })
        .collect();
        tags.retain(|tag| self.tags.iter().all(|other| other.number != tag.number));
        tags.extend(self.tags.iter().map(|tag| Tag { number: tag.number, kind: tag.kind, values: tag.values.clone() }));
        tags.sort_by_key(|tag| tag.number);
        tags
    }
}

/// Whether numbers begin with their high or their low byte.
#[derive(Clone, Copy, PartialEq)]
pub enum Order {
    Big,
    Little,
}

impl Order {
    fn short(self, number: u16) -> [u8; 2] {
        match self {
            Self::Big => number.to_be_bytes(),
            Self::Little => number.to_le_bytes(),
        }
    }

    fn long(self, number: u32) -> [u8; 4] {
        match self {
            Self::Big => number.to_be_bytes(),
            Self::Little => number.to_le_bytes(),
        }
    }
}

/// A TIFF file with these pages.
pub fn tiff(order: Order, pages: &[Page]) -> Vec<u8> {
    let mut file = match order {
        Order::Big => b"MM".to_vec(),
        Order::Little => b"II".to_vec(),
    };
    file.extend(order.short(42));
    // The place where the offset of the next directory stands.
    let mut link = file.len();
    file.extend([0; 4]);
    for page in pages {
        let samples_at = file.len() as u32;
        for sample in &page.samples {
            match page.bits {
                8 => file.push(*sample as u8),
                _ => file.extend(order.short(*sample)),
            }
        }
        file.resize(file.len().next_multiple_of(2), 0);
        let tags = page.all_tags(samples_at);
        let mut entries = Vec::new();
        for tag in &tags {
            let values: Vec<u8> = tag
                .values
                .iter()
                .flat_map(|value| match tag.kind {
                    3 => order.short(*value as u16).to_vec(),
                    4 => order.long(*value).to_vec(),
                    _ => vec![*value as u8],
                })
                .collect();
            entries.extend([order.short(tag.number), order.short(tag.kind)].concat());
            entries.extend(order.long(tag.values.len() as u32));
            if values.len() <= 4 {
                entries.extend(&values);
                entries.resize(entries.len().next_multiple_of(4), 0);
                entries.extend(vec![0; 4 * usize::from(values.is_empty())]);
            } else {
                entries.extend(order.long(file.len() as u32));
                file.extend(&values);
                file.resize(file.len().next_multiple_of(2), 0);
            }
        }
        let at = order.long(file.len() as u32);
        file[link..link + 4].copy_from_slice(&at);
        file.extend(order.short(tags.len() as u16));
        file.extend(&entries);
        link = file.len();
        file.extend([0; 4]);
    }
    file
}
