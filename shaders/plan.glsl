// Sampling `planned`: how far samples may lie apart, block by block. The host weighs how the field varies in each block against
// the transfer function (renderers/bindings/plan_bindings.cpp).
DEFINE_INT(AMRTEX_PLANNED)  // 1 where steps are planned, else 0

#define AMRTEX_PLAN_CONSTANT 255   // code of a block in which one interval is exact, however long
#define AMRTEX_PLAN_LEAST real(0.125)  // cell widths of a region
#define AMRTEX_PLAN_MOST real(8)       // cell widths of a region

#if AMRTEX_CPP || AMRTEX_PLANNED
BUFFER(uint, planned_steps, planned_steps_block)  // codes of four blocks a word, x fastest, lowest byte first
UNIFORM(ivec3, u_plan_blocks)  // along each axis
UNIFORM(int, u_plan_shift)     // log2 of a block's edge, finest cells

// The code of the block that holds a finest cell: the step is 2^(code / 8 - 4) units of ray length.
int plan_code(IN(ivec3) cell) {
  ivec3 block = cell >> u_plan_shift;
  int index = block.x + u_plan_blocks.x * (block.y + u_plan_blocks.y * block.z);
  return int((planned_steps[index >> 2] >> uint((index & 3) << 3)) & 255u);
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
  return clamp(exp2(real(code) * real(0.125) - real(4)), AMRTEX_PLAN_LEAST * width, AMRTEX_PLAN_MOST * width);
}
#else
real planned_step(IN(Region) r, IN(vec3r) f, IN(vec3r) direction, IN(real) length) { return length; }
#endif
