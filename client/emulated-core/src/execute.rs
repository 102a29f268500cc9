//! Executes instructions.
//!
//! The cycles are those that rp2040js and `core_cycles.mjs` count.
//!
//! The file is longer than most, because it is the list of all instructions.

use crate::cache::{Cache, is_flash};
use crate::chip::{Chip, Divider, FLASH_BYTES, RAM, RAM_BYTES, Shared};

/// The upper byte of the addresses at which the core executes flash.
const FLASH_CODE: u32 = 0x10;
/// Where the block SIO begins, and where the divider lies in it.
const SIO: u32 = 0xd000_0000;
const DIVIDER: u32 = 0x60;
const DIVIDER_BYTES: u32 = 0x1c;
const SP: usize = 13;
const LR: usize = 14;
const PC: usize = 15;

/// Why an instruction is left to rp2040js: it reaches something else than RAM, flash and the
/// divider, or is rare. Nothing of it has been done.
struct LeftAlone;

/// RAM and flash, as the core reads and writes them.
struct Memory<'a> {
    ram: &'a mut [u8; RAM_BYTES],
    flash: &'a [u8; FLASH_BYTES],
    cache: &'a mut Cache,
}

/// Returns where so many bytes at an address lie in RAM, if they do and the address is aligned.
#[inline(always)]
const fn in_ram(address: u32, bytes: u32) -> Option<usize> {
    let at = address.wrapping_sub(RAM);
    if address & (bytes - 1) == 0 && at <= RAM_BYTES as u32 - bytes {
        Some(at as usize)
    } else {
        None
    }
}

/// Returns the registers of a list in ascending order.
#[inline(always)]
fn listed(list: u16) -> impl Iterator<Item = usize> {
    (0..8).filter(move |register| list & 1 << register != 0)
}

impl Memory<'_> {
    /// Returns the half word of an instruction in RAM or flash. The address is even.
    #[inline(always)]
    fn half(&self, address: u32) -> u16 {
        if address >> 24 == FLASH_CODE {
            let at = address as usize & (FLASH_BYTES - 2);
            u16::from_le_bytes([self.flash[at], self.flash[at + 1]])
        } else {
            let at = (address.wrapping_sub(RAM) as usize).min(RAM_BYTES - 2);
            u16::from_le_bytes([self.ram[at], self.ram[at + 1]])
        }
    }

    /// Loads 1, 2 or 4 bytes.
    #[inline(always)]
    fn load<const BYTES: usize>(
        &mut self,
        shared: &mut Shared,
        address: u32,
    ) -> Result<u32, LeftAlone> {
        let mut value = [0; 4];
        if let Some(at) = in_ram(address, BYTES as u32) {
            value[..BYTES].copy_from_slice(&self.ram[at..at + BYTES]);
            return Ok(u32::from_le_bytes(value));
        }
        if !is_flash(address) || address as usize & (BYTES - 1) != 0 {
            return Err(LeftAlone);
        }
        let at = address as usize & (FLASH_BYTES - 1) & !(BYTES - 1);
        value[..BYTES].copy_from_slice(&self.flash[at..at + BYTES]);
        let garbage = self.cache.data(shared, address) & u32::MAX >> (32 - 8 * BYTES);
        Ok(u32::from_le_bytes(value) ^ garbage)
    }

    /// Stores 1, 2 or 4 bytes.
    #[inline(always)]
    fn store<const BYTES: usize>(&mut self, address: u32, value: u32) -> Result<(), LeftAlone> {
        let at = in_ram(address, BYTES as u32).ok_or(LeftAlone)?;
        self.ram[at..at + BYTES].copy_from_slice(&value.to_le_bytes()[..BYTES]);
        Ok(())
    }

    /// Returns where `words` words at an address lie in RAM, if there are any and they do.
    #[inline(always)]
    fn words_in_ram(address: u32, words: u32) -> Result<usize, LeftAlone> {
        let last = address.wrapping_add(4 * words).wrapping_sub(4);
        match (in_ram(address, 4), in_ram(last, 4)) {
            (Some(at), Some(_)) if words != 0 => Ok(at),
            _ => Err(LeftAlone),
        }
    }

    /// Reads a word of RAM whose place has been checked.
    #[inline(always)]
    fn word(&self, at: usize) -> u32 {
        let mut value = [0; 4];
        value.copy_from_slice(&self.ram[at..at + 4]);
        u32::from_le_bytes(value)
    }

    /// Writes a word of RAM whose place has been checked.
    #[inline(always)]
    fn set_word(&mut self, at: usize, value: u32) {
        self.ram[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
}

/// The flags: N and Z as those of a result, C as 0 or 1, and V as the sign.
struct Flags {
    result: u32,
    carry: u32,
    overflow: u32,
}

impl Flags {
    /// Adds, with a carry of 0 or 1.
    #[inline(always)]
    fn add(&mut self, one: u32, other: u32, carry: u32) -> u32 {
        let sum = u64::from(one) + u64::from(other) + u64::from(carry);
        self.result = sum as u32;
        self.carry = (sum >> 32) as u32;
        self.overflow = (one ^ self.result) & (other ^ self.result);
        self.result
    }

    /// Subtracts.
    #[inline(always)]
    fn subtract(&mut self, one: u32, other: u32) -> u32 {
        self.result = one.wrapping_sub(other);
        self.carry = u32::from(one >= other);
        self.overflow = (one ^ other) & (one ^ self.result);
        self.result
    }

    /// Takes a result that leaves C and V as they are.
    #[inline(always)]
    fn set(&mut self, result: u32) -> u32 {
        self.result = result;
        result
    }

    /// Whether the condition with this number holds.
    #[inline(always)]
    fn hold(&self, condition: u16) -> bool {
        let (zero, negative) = (self.result == 0, (self.result as i32) < 0);
        let overflow = (self.overflow as i32) < 0;
        let holds = match condition >> 1 {
            0 => zero,
            1 => self.carry != 0,
            2 => negative,
            3 => overflow,
            4 => self.carry != 0 && !zero,
            5 => negative == overflow,
            _ => !zero && negative == overflow,
        };
        holds != (condition & 1 != 0)
    }
}

/// The core while it executes.
struct Core<'a, D> {
    memory: Memory<'a>,
    shared: &'a mut Shared,
    divider: &'a mut D,
    flags: Flags,
}

/// What an instruction takes, in cycles, and the address of the next one.
struct Done {
    cycles: u32,
    next: u32,
}

impl Chip {
    /// Executes instructions until this many cycles have passed, or until an instruction comes that
    /// is left to rp2040js, or that bears one of the marks. Returns the cycles that have passed.
    pub fn run<D: Divider>(&mut self, limit: u32, divider: &mut D) -> u32 {
        let Self { shared, ram, flash, cache, marks } = self;
        let [negative, zero, carry, overflow] = shared.flags;
        // No result is negative and zero, which would need more to remember than one number.
        if negative != 0 && zero != 0 {
            return 0;
        }
        let result = if zero != 0 { 0 } else { 1 | negative << 31 };
        let flags = Flags { result, carry, overflow: overflow << 31 };
        let mut core = Core { memory: Memory { ram, flash, cache }, shared, divider, flags };
        let mut pc = core.shared.registers[PC];
        let mut cycles = 0;
        while cycles < limit {
            let in_flash = pc >> 24 == FLASH_CODE;
            if !in_flash && pc.wrapping_sub(RAM) >= RAM_BYTES as u32 - 2 {
                break;
            }
            let op = core.memory.half(pc);
            if pc.wrapping_sub(core.shared.line) >= 6 {
                core.memory.cache.fetch(core.shared, pc, op);
            }
            if core.shared.stalled != 0 {
                // Time may bring something before the core goes on.
                cycles += core.shared.stalled;
                core.shared.stalled = 0;
                continue;
            }
            if marks.contain(pc) {
                break;
            }
            let Ok(done) = core.execute(pc, op) else { break };
            pc = done.next;
            cycles += done.cycles;
        }
        let Flags { result, carry, overflow } = core.flags;
        shared.registers[PC] = pc;
        shared.flags = [result >> 31, u32::from(result == 0), carry, overflow >> 31];
        cycles
    }

    /// Fetches the instruction at an address, as [`Self::run`] does before it executes one.
    pub fn fetch(&mut self, address: u32) {
        let at = address as usize & (FLASH_BYTES - 2);
        let first = u16::from_le_bytes([self.flash[at], self.flash[at + 1]]);
        self.cache.fetch(&mut self.shared, address, first);
    }
}

impl<D: Divider> Core<'_, D> {
    #[inline(always)]
    fn low(&self, op: u16, from: u32) -> u32 {
        self.shared.registers[usize::from(op >> from & 7)]
    }

    #[inline(always)]
    fn set_low(&mut self, op: u16, from: u32, value: u32) {
        self.shared.registers[usize::from(op >> from & 7)] = value;
    }

    /// Executes one instruction.
    #[inline(always)]
    fn execute(&mut self, pc: u32, op: u16) -> Result<Done, LeftAlone> {
        let mut cycles = 1;
        let mut next = pc.wrapping_add(2);
        match op >> 11 {
            kind @ 0..=2 => {
                let (value, by) = (self.low(op, 3), u32::from(op >> 6 & 31));
                let result = self.shift(kind, value, by);
                self.set_low(op, 0, result);
            }
            3 => {
                let one = self.low(op, 3);
                let other = if op & 0x400 != 0 { u32::from(op >> 6 & 7) } else { self.low(op, 6) };
                let result = if op & 0x200 != 0 {
                    self.flags.subtract(one, other)
                } else {
                    self.flags.add(one, other, 0)
                };
                self.set_low(op, 0, result);
            }
            4 => {
                let result = self.flags.set(u32::from(op & 0xff));
                self.set_low(op, 8, result);
            }
            kind @ 5..=7 => {
                let (one, other) = (self.low(op, 8), u32::from(op & 0xff));
                if kind == 6 {
                    let sum = self.flags.add(one, other, 0);
                    self.set_low(op, 8, sum);
                } else {
                    let difference = self.flags.subtract(one, other);
                    if kind == 7 {
                        self.set_low(op, 8, difference);
                    }
                }
            }
            8 if op < 0x4400 => self.two_low_registers(op)?,
            8 => {
                let m = usize::from(op >> 3 & 15);
                let d = usize::from(op >> 4 & 8 | op & 7);
                let kind = op >> 8 & 3;
                let registers = &mut self.shared.registers;
                if kind == 3 {
                    let to = registers[m];
                    // The return from an exception, and what is no address of an instruction.
                    if m == PC || op & 7 != 0 || to >> 28 == 15 {
                        return Err(LeftAlone);
                    }
                    if op & 0x80 != 0 {
                        registers[LR] = pc.wrapping_add(2) | 1;
                    }
                    return Ok(Done { cycles: 2, next: to & !1 });
                }
                if d == PC || m == PC || d == SP && kind != 0 {
                    return Err(LeftAlone);
                }
                match kind {
                    0 => {
                        let sum = registers[d].wrapping_add(registers[m]);
                        registers[d] = if d == SP { sum & !3 } else { sum };
                    }
                    1 => drop(self.flags.subtract(registers[d], registers[m])),
                    _ => registers[d] = registers[m],
                }
            }
            9 => {
                let address = (pc.wrapping_add(4) & !3).wrapping_add(u32::from(op & 0xff) << 2);
                let value = self.memory.load::<4>(self.shared, address)?;
                self.set_low(op, 8, value);
                cycles = 2;
            }
            10 | 11 => {
                self.load_or_store(op)?;
                cycles = 2;
            }
            12 => {
                let address = self.low(op, 3).wrapping_add(u32::from(op >> 4 & 0x7c));
                let value = self.low(op, 0);
                if self.memory.store::<4>(address, value).is_ok() {
                    cycles = 2;
                } else {
                    self.divider.write(divider_offset(address)?, value);
                }
            }
            13 => {
                let address = self.low(op, 3).wrapping_add(u32::from(op >> 4 & 0x7c));
                let value = if let Ok(value) = self.memory.load::<4>(self.shared, address) {
                    cycles = 2;
                    value
                } else {
                    self.divider.read(divider_offset(address)?)
                };
                self.set_low(op, 0, value);
            }
            kind @ 14..=17 => {
                let by = u32::from(op >> 6 & 31) << (kind >> 4);
                let (address, value) = (self.low(op, 3).wrapping_add(by), self.low(op, 0));
                match kind {
                    14 => self.memory.store::<1>(address, value)?,
                    15 => {
                        let value = self.memory.load::<1>(self.shared, address)?;
                        self.set_low(op, 0, value);
                    }
                    16 => self.memory.store::<2>(address, value)?,
                    _ => {
                        let value = self.memory.load::<2>(self.shared, address)?;
                        self.set_low(op, 0, value);
                    }
                }
                cycles = 2;
            }
            kind @ 18..=19 => {
                let address = self.shared.registers[SP].wrapping_add(u32::from(op & 0xff) << 2);
                if kind == 18 {
                    self.memory.store::<4>(address, self.low(op, 8))?;
                } else {
                    let value = self.memory.load::<4>(self.shared, address)?;
                    self.set_low(op, 8, value);
                }
                cycles = 2;
            }
            kind @ 20..=21 => {
                let base =
                    if kind == 20 { pc.wrapping_add(4) & !3 } else { self.shared.registers[SP] };
                self.set_low(op, 8, base.wrapping_add(u32::from(op & 0xff) << 2));
            }
            22 => cycles = self.extend_or_push(op)?,
            23 => {
                if op >> 9 != 0b101_1110 {
                    return Err(LeftAlone);
                }
                let (low, pops_pc) = ((op & 0xff).count_ones(), op & 0x100 != 0);
                let address = self.shared.registers[SP];
                let words = low + u32::from(pops_pc);
                let mut at = Memory::words_in_ram(address, words)?;
                cycles = 1 + low;
                if pops_pc {
                    let to = self.memory.word(at + 4 * low as usize);
                    if to >> 28 == 15 {
                        return Err(LeftAlone);
                    }
                    next = to & !1;
                    self.shared.stalled += self.shared.call_cycles;
                    cycles += 2;
                }
                for register in listed(op) {
                    self.shared.registers[register] = self.memory.word(at);
                    at += 4;
                }
                self.shared.registers[SP] = address.wrapping_add(4 * words);
            }
            24 => {
                let (n, count) = (usize::from(op >> 8 & 7), (op & 0xff).count_ones());
                let address = self.shared.registers[n];
                // With the base among them the order matters.
                if op & 1 << n != 0 {
                    return Err(LeftAlone);
                }
                let mut at = Memory::words_in_ram(address, count)?;
                for register in listed(op) {
                    self.memory.set_word(at, self.shared.registers[register]);
                    at += 4;
                }
                self.shared.registers[n] = address.wrapping_add(4 * count);
                cycles = 1 + count;
            }
            25 => {
                let (n, count) = (usize::from(op >> 8 & 7), (op & 0xff).count_ones());
                let mut address = self.shared.registers[n];
                let last = address.wrapping_add(4 * count).wrapping_sub(4);
                let can_load = |address| in_ram(address, 4).is_some() || is_flash(address);
                if count == 0 || address & 3 != 0 || !can_load(address) || !can_load(last) {
                    return Err(LeftAlone);
                }
                for register in listed(op) {
                    let value = self.memory.load::<4>(self.shared, address)?;
                    self.shared.registers[register] = value;
                    address = address.wrapping_add(4);
                }
                if op & 1 << n == 0 {
                    self.shared.registers[n] = address;
                }
                cycles = 1 + count;
            }
            26 | 27 => {
                let condition = op >> 8 & 15;
                if condition >= 14 {
                    return Err(LeftAlone);
                }
                if self.flags.hold(condition) {
                    next = pc.wrapping_add(4).wrapping_add_signed(i32::from(op as i8) << 1);
                    cycles = 2;
                }
            }
            28 => {
                next = pc.wrapping_add(4).wrapping_add_signed(i32::from((op << 5) as i16) >> 4);
                cycles = 2;
            }
            30 => {
                let second = self.memory.half(pc.wrapping_add(2));
                next = if second & 0xd000 == 0xd000 {
                    self.shared.registers[LR] = pc.wrapping_add(4) | 1;
                    pc.wrapping_add(4).wrapping_add(call_distance(op, second))
                } else {
                    if op == 0xf3ef && second & 0xf8ff == 0x8010 {
                        // MRS of PRIMASK
                        self.shared.registers[usize::from(second >> 8 & 7)] = self.shared.is_masked;
                    } else if op != 0xf3bf || !(0x8f40..=0x8f6f).contains(&second) {
                        // Not one of the barriers DSB, DMB and ISB: nothing is done out of order.
                        return Err(LeftAlone);
                    }
                    pc.wrapping_add(4)
                };
                cycles = 3;
            }
            _ => return Err(LeftAlone),
        }
        Ok(Done { cycles, next })
    }

    /// Shifts by a number of the instruction: to the left (0), to the right (1), or to the right
    /// with the sign (2). By 0 the last two shift by 32.
    #[inline(always)]
    fn shift(&mut self, kind: u16, value: u32, by: u32) -> u32 {
        let flags = &mut self.flags;
        if kind == 0 {
            if by != 0 {
                flags.carry = value >> (32 - by) & 1;
            }
            return flags.set(value << by);
        }
        flags.carry = value >> (if by == 0 { 31 } else { by - 1 }) & 1;
        if kind == 1 {
            flags.set(if by == 0 { 0 } else { value >> by })
        } else {
            flags.set((value as i32 >> (if by == 0 { 31 } else { by })) as u32)
        }
    }

    /// Executes one of the sixteen instructions that take two of the registers R0 to R7.
    #[inline(always)]
    fn two_low_registers(&mut self, op: u16) -> Result<(), LeftAlone> {
        let (one, other) = (self.low(op, 0), self.low(op, 3));
        let by = other & 0xff;
        let flags = &mut self.flags;
        let result = match op >> 6 & 15 {
            0 => flags.set(one & other),
            1 => flags.set(one ^ other),
            2 => {
                if by != 0 {
                    flags.carry =
                        if by <= 32 { (u64::from(one) << by >> 32) as u32 & 1 } else { 0 };
                }
                flags.set(if by < 32 { one << by } else { 0 })
            }
            3 => {
                if by != 0 {
                    flags.carry = if by <= 32 { one >> (by - 1) & 1 } else { 0 };
                }
                flags.set(if by < 32 { one >> by } else { 0 })
            }
            4 => {
                if by != 0 {
                    flags.carry = (one as i32 >> (by - 1).min(31)) as u32 & 1;
                }
                flags.set((one as i32 >> by.min(31)) as u32)
            }
            5 => flags.add(one, other, flags.carry),
            6 => flags.add(one, !other, flags.carry),
            8 => {
                flags.set(one & other);
                return Ok(());
            }
            9 => flags.subtract(0, other),
            10 => {
                flags.subtract(one, other);
                return Ok(());
            }
            11 => {
                flags.add(one, other, 0);
                return Ok(());
            }
            12 => flags.set(one | other),
            13 => flags.set(one.wrapping_mul(other)),
            14 => flags.set(one & !other),
            15 => flags.set(!other),
            _ => return Err(LeftAlone),
        };
        self.set_low(op, 0, result);
        Ok(())
    }

    /// Executes a load or store at the sum of two registers.
    #[inline(always)]
    fn load_or_store(&mut self, op: u16) -> Result<(), LeftAlone> {
        let (address, value) = (self.low(op, 3).wrapping_add(self.low(op, 6)), self.low(op, 0));
        let memory = &mut self.memory;
        let loaded = match op >> 9 & 7 {
            0 => return memory.store::<4>(address, value),
            1 => return memory.store::<2>(address, value),
            2 => return memory.store::<1>(address, value),
            3 => memory.load::<1>(self.shared, address)? as i8 as u32,
            4 => memory.load::<4>(self.shared, address)?,
            5 => memory.load::<2>(self.shared, address)?,
            6 => memory.load::<1>(self.shared, address)?,
            _ => memory.load::<2>(self.shared, address)? as i16 as u32,
        };
        self.set_low(op, 0, loaded);
        Ok(())
    }

    /// Executes an extension of a byte or half word, a change of the stack pointer, or a PUSH.
    /// Returns its cycles.
    #[inline(always)]
    fn extend_or_push(&mut self, op: u16) -> Result<u32, LeftAlone> {
        if op >> 8 == 0xb0 {
            let by = u32::from(op & 0x7f) << 2;
            let sp = &mut self.shared.registers[SP];
            *sp = if op & 0x80 != 0 { sp.wrapping_sub(by) } else { sp.wrapping_add(by) };
            return Ok(1);
        }
        if op >> 8 == 0xb2 {
            let value = self.low(op, 3);
            let extended = match op >> 6 & 3 {
                0 => value as i16 as u32,
                1 => value as i8 as u32,
                2 => value & 0xffff,
                _ => value & 0xff,
            };
            self.set_low(op, 0, extended);
            return Ok(1);
        }
        if op >> 9 != 0b101_1010 {
            return Err(LeftAlone);
        }
        let (low, pushes_lr) = ((op & 0xff).count_ones(), op & 0x100 != 0);
        let words = low + u32::from(pushes_lr);
        let address = self.shared.registers[SP].wrapping_sub(4 * words);
        let mut at = Memory::words_in_ram(address, words)?;
        self.shared.registers[SP] = address;
        for register in listed(op) {
            self.memory.set_word(at, self.shared.registers[register]);
            at += 4;
        }
        if pushes_lr {
            self.memory.set_word(at, self.shared.registers[LR]);
        }
        Ok(1 + low)
    }
}

/// Returns where a register of the divider lies in SIO.
#[inline(always)]
const fn divider_offset(address: u32) -> Result<u32, LeftAlone> {
    let offset = address.wrapping_sub(SIO);
    if address & 3 == 0 && offset.wrapping_sub(DIVIDER) < DIVIDER_BYTES {
        Ok(offset)
    } else {
        Err(LeftAlone)
    }
}

/// Returns how far a BL of two half words goes.
const fn call_distance(first: u16, second: u16) -> u32 {
    let (first, second) = (first as u32, second as u32);
    let sign = first >> 10 & 1;
    let i1 = !(second >> 13 ^ sign) & 1;
    let i2 = !(second >> 11 ^ sign) & 1;
    let top = if sign != 0 { 0xff00_0000 } else { 0 };
    top | i1 << 23 | i2 << 22 | (first & 0x3ff) << 12 | (second & 0x7ff) << 1
}
