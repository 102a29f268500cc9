//! The checksums, each defined once: CRC-16 for lines; CRC-32 for models, options and records in
//! flash.

use crc::{CRC_16_IBM_3740, CRC_32_ISO_HDLC, Crc, Table};

/// CRC-32 as in Ethernet and zip files, with a table of 1 KiB.
pub static CRC_32: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// CRC-16 with the polynomial 0x1021 and the initial value 0xFFFF, also known as
/// CRC-16/CCITT-FALSE. It works without a table, because lines are short.
pub const CRC_16: Crc<u16, Table<0>> = Crc::<u16, Table<0>>::new(&CRC_16_IBM_3740);
