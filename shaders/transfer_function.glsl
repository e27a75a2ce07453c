// Value -> emitted colour and extinction, from a table that is piecewise linear over
// the value (or its log10). The host places the table's entries on the points of the
// transfer function wherever their spacing allows, so that the table is exact.
#if !AMRTEX_CPP
#ifndef AMRTEX_LOGARITHMIC
#error AMRTEX_LOGARITHMIC must be defined: 1 where the table is over log10(value), else 0
#endif
#endif
DEFINE_INT(AMRTEX_LOGARITHMIC)

BUFFER(vec4r, transfer_table, transfer_table_block)         // rgb, extinction per unit of ray length
BUFFER(real, transfer_next_visible, transfer_next_visible_block)   // entry i: smallest visible value of bins i and above (a large number when none)
UNIFORM(vec2r, u_transfer_axis)       // table position = (axis value - x) * y
UNIFORM(int, u_transfer_last)         // index of the table's last entry, at least 1

real transfer_position(IN(real) value) {
  real x = value;
  if (AMRTEX_LOGARITHMIC != 0) x = log2(max(value, real(1e-37))) * real(0.30102999566398119521);
  return clamp((x - u_transfer_axis.x) * u_transfer_axis.y, real(0), real(u_transfer_last));
}

// rgb, extinction
vec4r transfer(IN(real) value) {
  real x = transfer_position(value);
  int i = min(int(x), u_transfer_last - 1);
  real f = x - real(i);
  vec4r low = transfer_table[i];
  vec4r high = transfer_table[i + 1];
  return low + (high - low) * f;
}

// May any value of the range have an extinction above 0? Conservative.
bool transfer_visible(IN(vec2r) value_range) {
  int i = min(int(transfer_position(value_range.x)), u_transfer_last);
  return transfer_next_visible[i] <= value_range.y;
}
