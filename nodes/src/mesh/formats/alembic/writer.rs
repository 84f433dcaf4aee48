//! Writes small archives, for tests and trials.

/// A tree to write.
pub(crate) enum Item {
    Data(Vec<u8>),
    Group(Vec<Item>),
}

/// Writes an item after its children and returns its position; the top bit is set for data.
fn write(item: &Item, out: &mut Vec<u8>) -> u64 {
    match item {
        Item::Data(bytes) if bytes.is_empty() => 1 << 63,
        Item::Data(bytes) => {
            let at = out.len() as u64;
            out.extend((bytes.len() as u64).to_le_bytes());
            out.extend(bytes);
            at | 1 << 63
        }
        Item::Group(items) if items.is_empty() => 0,
        Item::Group(items) => {
            let children: Vec<u64> = items.iter().map(|i| write(i, out)).collect();
            let at = out.len() as u64;
            out.extend((children.len() as u64).to_le_bytes());
            children.iter().for_each(|c| out.extend(c.to_le_bytes()));
            at
        }
    }
}

/// A property: its header and its group.
pub(crate) struct Prop(Vec<u8>, Item);

fn sample(bytes: Vec<u8>) -> Item {
    let mut keyed = vec![7; 16];
    keyed.extend(bytes);
    Item::Data(keyed)
}

/// `changed` is first and last changed sample; the stored samples are those between, and sample 0.
pub(crate) fn property(
    name: &str,
    kind: u32,
    pod: u32,
    extent: u32,
    count: u8,
    changed: (u8, u8),
    stored: Vec<Vec<u8>>,
) -> Prop {
    let mut header = (kind | pod << 4 | 0x100 | 0x200 | extent << 12).to_le_bytes().to_vec();
    header.extend([count, changed.0, changed.1, 1, name.len() as u8]);
    header.extend(name.as_bytes());
    let mut items = Vec::new();
    for bytes in stored {
        items.push(sample(bytes));
        if kind == 2 {
            items.push(Item::Data(Vec::new()));
        }
    }
    Prop(header, Item::Group(items))
}

pub(crate) fn compound(name: &str, sub_properties: Vec<Prop>) -> Prop {
    let mut header = 0u32.to_le_bytes().to_vec();
    header.push(name.len() as u8);
    header.extend(name.as_bytes());
    Prop(header, properties(sub_properties))
}

fn properties(list: Vec<Prop>) -> Item {
    let (mut headers, mut items) = (Vec::new(), Vec::new());
    for Prop(header, item) in list {
        headers.extend(header);
        items.push(item);
    }
    items.push(Item::Data(headers));
    Item::Group(items)
}

pub(crate) fn object(props: Vec<Prop>, children: Vec<(&str, Item)>) -> Item {
    let (mut headers, mut items) = (Vec::new(), vec![properties(props)]);
    for (name, item) in children {
        headers.extend((name.len() as u32).to_le_bytes());
        headers.extend(name.as_bytes());
        headers.push(0);
        items.push(item);
    }
    headers.extend([0; 32]);
    items.push(Item::Data(headers));
    Item::Group(items)
}

pub(crate) fn archive(top: Item, sampling: &[f64], period: f64) -> Vec<u8> {
    let mut times = Vec::new();
    for (period, list) in [(1.0, &[0.0][..]), (period, sampling)] {
        times.extend(1u32.to_le_bytes());
        times.extend(f64::to_le_bytes(period));
        times.extend((list.len() as u32).to_le_bytes());
        list.iter().for_each(|t| times.extend(t.to_le_bytes()));
    }
    let root = Item::Group(vec![
        Item::Data(vec![0; 4]),
        Item::Data(10803u32.to_le_bytes().to_vec()),
        top,
        Item::Data(Vec::new()),
        Item::Data(times),
        Item::Data(Vec::new()),
    ]);
    let mut out = b"Ogawa\xff\0\x01\0\0\0\0\0\0\0\0".to_vec();
    let at = write(&root, &mut out);
    out[8..16].copy_from_slice(&at.to_le_bytes());
    out
}

pub(crate) fn f64s(v: &[f64]) -> Vec<u8> {
    v.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// The transform of an object: the codes of its operations, and their values in each sample.
pub(crate) fn xform(ops: &[u8], values: Vec<Vec<f64>>, inherits: u8) -> Prop {
    let last = values.len() as u8 - 1;
    let n = values[0].len() as u32;
    let stored: Vec<Vec<u8>> = values.iter().map(|v| f64s(v)).collect();
    compound(
        ".xform",
        vec![
            property(".inherits", 1, 0, 1, 1, (0, 0), vec![vec![inherits]]),
            property(".ops", 1, 1, ops.len() as u32, 1, (0, 0), vec![ops.to_vec()]),
            property(".vals", 1, 11, n, last + 1, (u8::from(last > 0), last), stored),
        ],
    )
}
