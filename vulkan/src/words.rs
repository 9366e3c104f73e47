//! Columns to and from the words of buffers. Reals of the kernel's precision keep their bits; no number is computed with.

use isograd_compiler::{ColumnType, Precision};
use isograd_runtime::{Column, Values};

use crate::VulkanError;

/// Fills elements of a column with the numbers from `from` on, or all with the one number there is.
pub(crate) fn put(values: Values<'_>, precision: Precision, from: usize, column: &mut [u8]) {
    match (values, precision) {
        (Values::F32(x), Precision::F32) => fill(x, from, column, |x| x.to_le_bytes()),
        #[expect(clippy::cast_possible_truncation, reason = "rounding to the kernel's precision")]
        (Values::F64(x), Precision::F32) => fill(x, from, column, |x| (x as f32).to_le_bytes()),
        (Values::I32(x), Precision::F32) => fill(x, from, column, |x| x.to_le_bytes()),
        (Values::F32(x), Precision::F64) => fill(x, from, column, |x| f64::from(x).to_le_bytes()),
        (Values::F64(x), Precision::F64) => fill(x, from, column, |x| x.to_le_bytes()),
        (Values::I32(x), Precision::F64) => fill(x, from, column, |x| i64::from(x).to_le_bytes()),
    }
}

fn fill<T: Copy, const N: usize>(values: &[T], from: usize, column: &mut [u8], bytes: impl Fn(T) -> [u8; N]) {
    let elements = column.as_chunks_mut::<N>().0;
    if let [one] = values {
        elements.fill(bytes(*one));
        return;
    }
    for (element, value) in elements.iter_mut().zip(values.get(from..).unwrap_or(&[])) {
        *element = bytes(*value);
    }
}

/// A column without numbers and with room for so many.
pub(crate) fn empty(scalar: ColumnType, precision: Precision, points: usize) -> Result<Column, VulkanError> {
    fn room<T>(points: usize) -> Result<Vec<T>, VulkanError> {
        let mut column = Vec::new();
        let bytes = (points as u64).saturating_mul(size_of::<T>() as u64);
        column.try_reserve_exact(points).map_err(|_| VulkanError::Memory { bytes })?;
        Ok(column)
    }
    Ok(match (scalar, precision) {
        (ColumnType::Real, Precision::F32) => Column::F32(room(points)?),
        (ColumnType::Real, Precision::F64) => Column::F64(room(points)?),
        (ColumnType::Int | ColumnType::Bool, _) => Column::I32(room(points)?),
    })
}

/// Appends elements of a kernel to a column.
pub(crate) fn take(column: &mut Column, precision: Precision, elements: &[u8]) {
    let quads = || elements.as_chunks::<4>().0.iter();
    let octets = || elements.as_chunks::<8>().0.iter();
    match (column, precision) {
        (Column::F32(x), _) => x.extend(quads().map(|e| f32::from_le_bytes(*e))),
        (Column::F64(x), _) => x.extend(octets().map(|e| f64::from_le_bytes(*e))),
        (Column::I32(x), Precision::F32) => x.extend(quads().map(|e| i32::from_le_bytes(*e))),
        #[expect(clippy::cast_possible_truncation, reason = "it is a sign-extended i32")]
        (Column::I32(x), Precision::F64) => x.extend(octets().map(|e| i64::from_le_bytes(*e) as i32)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Through a buffer and back.
    fn way(values: Values<'_>, scalar: ColumnType, precision: Precision, points: usize) -> Column {
        let mut buffer = vec![0xa5; points * precision.bytes() as usize];
        put(values, precision, 0, &mut buffer);
        let mut column = empty(scalar, precision, points).expect("room");
        take(&mut column, precision, &buffer);
        column
    }

    #[test]
    fn no_bit_changes_on_the_way() {
        let singles = [0, 1, 0x8000_0000, 0x7fa0_0001, 0xffff_ffff, 0x007f_ffff, 0xff80_0000].map(f32::from_bits);
        let Column::F32(back) = way(Values::F32(&singles), ColumnType::Real, Precision::F32, singles.len()) else {
            panic!("not f32")
        };
        assert_eq!(back.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), singles.map(f32::to_bits));
        let doubles = [0, 1, 1 << 63, 0x7ff4_0000_0000_0001, u64::MAX, 0x000f_ffff_ffff_ffff].map(f64::from_bits);
        let Column::F64(back) = way(Values::F64(&doubles), ColumnType::Real, Precision::F64, doubles.len()) else {
            panic!("not f64")
        };
        assert_eq!(back.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), doubles.map(f64::to_bits));
        let ints = [0, 1, -1, i32::MIN, i32::MAX];
        for precision in [Precision::F32, Precision::F64] {
            let back = way(Values::I32(&ints), ColumnType::Int, precision, ints.len());
            assert_eq!(back, Column::I32(ints.to_vec()), "{precision:?}");
            assert_eq!(way(Values::I32(&[-7]), ColumnType::Int, precision, 3), Column::I32(vec![-7; 3]));
        }
        let mut wide = [0; 8];
        put(Values::I32(&[-2]), Precision::F64, 0, &mut wide);
        assert_eq!(i64::from_le_bytes(wide), -2, "ints are sign-extended");
    }

    #[test]
    fn a_chunk_is_a_part() {
        let numbers: Vec<f64> = (0..10).map(f64::from).collect();
        let mut buffer = [0; 12];
        put(Values::F64(&numbers), Precision::F32, 6, &mut buffer);
        let mut column = Column::F32(vec![5.0]);
        take(&mut column, Precision::F32, &buffer);
        assert_eq!(column, Column::F32(vec![5.0, 6.0, 7.0, 8.0]));
        assert_eq!(
            way(Values::F32(&[0.1]), ColumnType::Real, Precision::F64, 1),
            Column::F64(vec![f64::from(0.1_f32)])
        );
    }
}
