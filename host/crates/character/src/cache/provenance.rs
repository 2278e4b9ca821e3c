//! How a character's weights were made, as bytes and back.

use armature_weights::handles::FREE_NEAR_JOINTS;

use super::bytes::{Reader, Writer};
use super::error::CacheError;
use crate::character::{HeatRecord, MonotoneRecord, Provenance, SolvedRecord, WeightsRecord};
use crate::handle_weights::{BiharmonicTier, DomainKind};

const ARTIST: u8 = 0;
const HEAT: u8 = 1;
const GENERATED_HEAT: u8 = 2;
/// Before version 4, bones were always released by [`FREE_NEAR_JOINTS`] and flat elements were not counted.
const OLD_BIHARMONIC: u8 = 3;
const OLD_GENERATED_BIHARMONIC: u8 = 4;
const BIHARMONIC: u8 = 5;
const GENERATED_BIHARMONIC: u8 = 6;
const MONOTONE: u8 = 7;
const GENERATED_MONOTONE: u8 = 8;

/// In the file, a tier or domain is its index here.
const TIERS: [BiharmonicTier; 2] = [BiharmonicTier::Interactive, BiharmonicTier::Certified];
const DOMAINS: [DomainKind; 4] = [DomainKind::Volume, DomainKind::Flat, DomainKind::OwnTetrahedra, DomainKind::Surface];

pub(super) fn write_provenance(w: &mut Writer, provenance: &Provenance) {
    write_tagged(w, provenance, [BIHARMONIC, GENERATED_BIHARMONIC]);
    let record = provenance.record();
    if let Some(WeightsRecord::Biharmonic(solved) | WeightsRecord::Monotone(MonotoneRecord { solved, .. })) = record {
        w.f64(solved.joint_release);
        // The count plus one, or 0 if unknown.
        w.count(solved.flat_elements.map_or(0, |count| count + 1));
    }
    if let Some(&WeightsRecord::Monotone(MonotoneRecord { order, spurious, solved: _ })) = record {
        w.byte(order);
        w.count(spurious);
    }
}

/// As before version 4.
pub(super) fn write_old_provenance(w: &mut Writer, provenance: &Provenance) {
    write_tagged(w, provenance, [OLD_BIHARMONIC, OLD_GENERATED_BIHARMONIC]);
}

fn write_tagged(w: &mut Writer, provenance: &Provenance, biharmonic: [u8; 2]) {
    w.byte(match provenance {
        Provenance::Artist => ARTIST,
        Provenance::Computed(WeightsRecord::BoneHeat(_)) => HEAT,
        Provenance::Generated(WeightsRecord::BoneHeat(_)) => GENERATED_HEAT,
        Provenance::Computed(WeightsRecord::Biharmonic(_)) => biharmonic[0],
        Provenance::Generated(WeightsRecord::Biharmonic(_)) => biharmonic[1],
        Provenance::Computed(WeightsRecord::Monotone(_)) => MONOTONE,
        Provenance::Generated(WeightsRecord::Monotone(_)) => GENERATED_MONOTONE,
    });
    match provenance.record() {
        None => {}
        Some(&WeightsRecord::BoneHeat(HeatRecord { heat, max_influences, residual, max_dropped })) => {
            w.f64(heat);
            w.count(max_influences);
            w.f64(residual);
            w.f64(max_dropped);
        }
        Some(WeightsRecord::Biharmonic(record)) => write_old_biharmonic(w, record),
        Some(WeightsRecord::Monotone(record)) => write_old_biharmonic(w, &record.solved),
    }
}

/// All but what version 4 added.
fn write_old_biharmonic(w: &mut Writer, record: &SolvedRecord) {
    // Destructured, so that a new field cannot be forgotten here.
    let &SolvedRecord {
        tier,
        domain,
        domain_vertices,
        joint_release: _,
        flat_elements: _,
        error_bound,
        energy,
        unconverged,
        largest_deviation,
        max_influences,
        max_dropped,
        mean_dropped,
    } = record;
    w.byte(TIERS.iter().position(|t| *t == tier).unwrap_or_default() as u8);
    w.byte(DOMAINS.iter().position(|d| *d == domain).unwrap_or_default() as u8);
    [domain_vertices, unconverged, max_influences].into_iter().for_each(|count| w.count(count));
    for number in [error_bound, energy, largest_deviation, max_dropped, mean_dropped] {
        w.f64(number);
    }
}

pub(super) fn read_provenance(r: &mut Reader) -> Result<Provenance, CacheError> {
    match r.byte()? {
        ARTIST => Ok(Provenance::Artist),
        HEAT => Ok(Provenance::Computed(read_heat(r)?)),
        GENERATED_HEAT => Ok(Provenance::Generated(read_heat(r)?)),
        OLD_BIHARMONIC => Ok(Provenance::Computed(WeightsRecord::Biharmonic(read_old_biharmonic(r)?))),
        OLD_GENERATED_BIHARMONIC => Ok(Provenance::Generated(WeightsRecord::Biharmonic(read_old_biharmonic(r)?))),
        BIHARMONIC => Ok(Provenance::Computed(WeightsRecord::Biharmonic(read_biharmonic(r)?))),
        GENERATED_BIHARMONIC => Ok(Provenance::Generated(WeightsRecord::Biharmonic(read_biharmonic(r)?))),
        MONOTONE => Ok(Provenance::Computed(read_monotone(r)?)),
        GENERATED_MONOTONE => Ok(Provenance::Generated(read_monotone(r)?)),
        kind => Err(r.bad(format!("weights of an unknown kind, {kind}"))),
    }
}

fn read_heat(r: &mut Reader) -> Result<WeightsRecord, CacheError> {
    let heat = r.f64()?;
    let max_influences = read_count(r)?;
    let record = HeatRecord { heat, max_influences, residual: r.f64()?, max_dropped: r.f64()? };
    Ok(WeightsRecord::BoneHeat(record))
}

fn read_biharmonic(r: &mut Reader) -> Result<SolvedRecord, CacheError> {
    let old = read_old_biharmonic(r)?;
    let joint_release = r.f64()?;
    let flat_elements = read_count(r)?.checked_sub(1);
    Ok(SolvedRecord { joint_release, flat_elements, ..old })
}

fn read_monotone(r: &mut Reader) -> Result<WeightsRecord, CacheError> {
    let solved = read_biharmonic(r)?;
    let (order, spurious) = (r.byte()?, read_count(r)?);
    Ok(WeightsRecord::Monotone(MonotoneRecord { order, spurious, solved }))
}

fn read_old_biharmonic(r: &mut Reader) -> Result<SolvedRecord, CacheError> {
    let tier = r.byte()?;
    let tier = *TIERS.get(usize::from(tier)).ok_or_else(|| r.bad(format!("an unknown tier of weights, {tier}")))?;
    let domain = r.byte()?;
    let domain =
        *DOMAINS.get(usize::from(domain)).ok_or_else(|| r.bad(format!("weights on something unknown, {domain}")))?;
    let [domain_vertices, unconverged, max_influences] = [read_count(r)?, read_count(r)?, read_count(r)?];
    Ok(SolvedRecord {
        tier,
        domain,
        domain_vertices,
        joint_release: FREE_NEAR_JOINTS,
        flat_elements: None,
        error_bound: r.f64()?,
        energy: r.f64()?,
        unconverged,
        largest_deviation: r.f64()?,
        max_influences,
        max_dropped: r.f64()?,
        mean_dropped: r.f64()?,
    })
}

fn read_count(r: &mut Reader) -> Result<usize, CacheError> {
    Ok(usize::try_from(u64::from_le_bytes(r.array()?)).unwrap_or(usize::MAX))
}
