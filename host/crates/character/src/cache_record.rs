//! How a character's weights came about, as bytes and back.

use crate::cache::CacheError;
use crate::cache_bytes::{Reader, Writer};
use crate::{BiharmonicRecord, BiharmonicTier, DomainKind, HeatRecord, Provenance, WeightsRecord};

const ARTIST: u8 = 0;
const HEAT: u8 = 1;
const GENERATED_HEAT: u8 = 2;
const BIHARMONIC: u8 = 3;
const GENERATED_BIHARMONIC: u8 = 4;

/// In the file a tier or domain is its place here.
const TIERS: [BiharmonicTier; 2] = [BiharmonicTier::Interactive, BiharmonicTier::Certified];
const DOMAINS: [DomainKind; 4] = [DomainKind::Volume, DomainKind::Flat, DomainKind::OwnTetrahedra, DomainKind::Surface];

pub(crate) fn write_provenance(w: &mut Writer, provenance: &Provenance) {
    w.byte(match provenance {
        Provenance::Artist => ARTIST,
        Provenance::Computed(WeightsRecord::BoneHeat(_)) => HEAT,
        Provenance::Generated(WeightsRecord::BoneHeat(_)) => GENERATED_HEAT,
        Provenance::Computed(WeightsRecord::Biharmonic(_)) => BIHARMONIC,
        Provenance::Generated(WeightsRecord::Biharmonic(_)) => GENERATED_BIHARMONIC,
    });
    match provenance.record() {
        None => {}
        Some(&WeightsRecord::BoneHeat(HeatRecord { heat, max_influences, residual, max_dropped })) => {
            w.f64(heat);
            w.count(max_influences);
            w.f64(residual);
            w.f64(max_dropped);
        }
        Some(WeightsRecord::Biharmonic(record)) => write_biharmonic(w, record),
    }
}

fn write_biharmonic(w: &mut Writer, record: &BiharmonicRecord) {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let &BiharmonicRecord {
        tier,
        domain,
        domain_vertices,
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

pub(crate) fn read_provenance(r: &mut Reader) -> Result<Provenance, CacheError> {
    match r.byte()? {
        ARTIST => Ok(Provenance::Artist),
        HEAT => Ok(Provenance::Computed(read_heat(r)?)),
        GENERATED_HEAT => Ok(Provenance::Generated(read_heat(r)?)),
        BIHARMONIC => Ok(Provenance::Computed(read_biharmonic(r)?)),
        GENERATED_BIHARMONIC => Ok(Provenance::Generated(read_biharmonic(r)?)),
        kind => Err(r.bad(format!("weights of an unknown kind, {kind}"))),
    }
}

fn read_heat(r: &mut Reader) -> Result<WeightsRecord, CacheError> {
    let heat = r.f64()?;
    let max_influences = read_count(r)?;
    let record = HeatRecord { heat, max_influences, residual: r.f64()?, max_dropped: r.f64()? };
    Ok(WeightsRecord::BoneHeat(record))
}

fn read_biharmonic(r: &mut Reader) -> Result<WeightsRecord, CacheError> {
    let tier = r.byte()?;
    let tier = *TIERS.get(usize::from(tier)).ok_or_else(|| r.bad(format!("an unknown tier of weights, {tier}")))?;
    let domain = r.byte()?;
    let domain =
        *DOMAINS.get(usize::from(domain)).ok_or_else(|| r.bad(format!("weights on something unknown, {domain}")))?;
    let [domain_vertices, unconverged, max_influences] = [read_count(r)?, read_count(r)?, read_count(r)?];
    Ok(WeightsRecord::Biharmonic(BiharmonicRecord {
        tier,
        domain,
        domain_vertices,
        error_bound: r.f64()?,
        energy: r.f64()?,
        unconverged,
        largest_deviation: r.f64()?,
        max_influences,
        max_dropped: r.f64()?,
        mean_dropped: r.f64()?,
    }))
}

fn read_count(r: &mut Reader) -> Result<usize, CacheError> {
    Ok(usize::try_from(u64::from_le_bytes(r.array()?)).unwrap_or(usize::MAX))
}
