// Sampling `planned`: how far samples may lie apart, block by block. The host weighs how the field varies in each block against
// the transfer function (renderers/bindings/plan_bindings.cpp).
DEFINE_INT(AMRTEX_PLANNED)  // 1 where steps are planned, else 0

#define AMRTEX_PLAN_LEAST real(0.125)  // cell widths of a region
#define AMRTEX_PLAN_MOST real(8)       // cell widths of a region

#if AMRTEX_CPP || AMRTEX_PLANNED
BUFFER(uint, planned_steps, planned_steps_block)  // codes, laid out in block_maps.h
UNIFORM(ivec3, u_plan_blocks)  // along each axis
UNIFORM(int, u_plan_shift)     // log2 of a block's edge, finest cells

// The code of the block that holds a finest cell.
int plan_code(IN(ivec3) cell) {
  uint index = block_index(cell >> u_plan_shift, u_plan_blocks);
  return byte_of(planned_steps[index / AMRTEX_BYTES_IN_WORD], index);
}

// The step for `length` of a ray in a region, from `f` on (finest cells from its lower corner): the shorter one of those where it
// enters and where it leaves. Between blocks steps differ by no more than their distance. (That of the block in the middle alone saves
// a look-up and costs 10 dB in regions larger than a block.)
real planned_step(IN(Region) r, IN(vec3r) f, IN(vec3r) direction, IN(real) length) {
  ivec3 last = r.upper - r.lower - ivec3(1);
  int enter = plan_code(r.lower + clamp(ivec3(floor(f)), ivec3(0), last));
  int leave = plan_code(r.lower + clamp(ivec3(floor(f + direction * length)), ivec3(0), last));
  int code = min(enter, leave);
  if (code == AMRTEX_PLAN_CONSTANT) return length;
  real width = real(r.width);
  return clamp(exp2(real(code) / real(AMRTEX_PLAN_CODES_AN_OCTAVE) - real(AMRTEX_PLAN_OCTAVES_BELOW_ONE)), AMRTEX_PLAN_LEAST * width, AMRTEX_PLAN_MOST * width);
}
#else
real planned_step(IN(Region) r, IN(vec3r) f, IN(vec3r) direction, IN(real) length) { return length; }
#endif
