//! Places on a mesh, as the words of a line in a text file.

use glam::DVec3;

/// All words as finite numbers.
pub fn numbers(words: &[&str]) -> Result<Vec<f64>, String> {
    let number = |word: &&str| match word.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("{word:?} is not a number")),
    };
    words.iter().map(number).collect()
}

/// A point.
pub fn point(words: &[&str]) -> Result<[f64; 3], String> {
    numbers(words)?.try_into().map_err(|_| "a point has three coordinates".to_owned())
}

/// The centre and the radius of a ball.
pub fn ball(words: &[&str]) -> Result<(DVec3, f64), String> {
    match numbers(words)?.as_slice() {
        &[x, y, z, radius] if radius > 0.0 => Ok((DVec3::new(x, y, z), radius)),
        _ => Err("region is followed by x, y, z and a radius above 0".into()),
    }
}

/// One of `count` vertices.
pub fn vertex(word: &str, count: usize) -> Result<usize, String> {
    match word.parse::<usize>() {
        Ok(vertex) if vertex < count => Ok(vertex),
        _ => Err(format!("{word:?} is no vertex; they are numbered from 0 to {}", count.saturating_sub(1))),
    }
}
