// Writes stored pages and the table.
#pragma once

#include <tbb/parallel_for.h>

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "page_partition.hpp"
#include "page_pool.hpp"
#include "page_reader.hpp"
#include "page_table_plan.hpp"
#include "structures/common/build_tools.hpp"

namespace amrtex::pages {

/// `at`: its first texel.
inline void write_page(const Options& o, const Vec3i& at, Storage storage, StorageScale scale, std::span<const double> values,
                       HostTexture& texture) {
  const Box all{Vec3i(0), texture.size};
  const auto edge = static_cast<std::size_t>(o.edge);
  for (int z = 0; z < o.edge; ++z)
    for (int y = 0; y < o.edge; ++y)
      store_values(storage, scale, &values[edge * (static_cast<std::size_t>(y) + edge * static_cast<std::size_t>(z))], edge,
                   texture.data.data(), all.offset(at + Vec3i(0, y, z)));
}

/// Writes stored pages: values, validity bits and coded ranges.
class PageWriter {
 public:
  /// `field`: with its parts, which are written.
  PageWriter(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const PagePool& pool, EncodedField& field)
      : request_(request),
        options_(o),
        pool_(pool),
        field_(field),
        reader_(h, o),
        validity_(field.find("page_validity")),
        more_ranges_(field, "page_more_ranges") {
    // node-centred pages lie side by side without a border
    const bool leaks = field.filtering == Filtering::hardware && o.nodes;
    for (int i = 0; i < field.field_count * pool.textures; ++i) pools_.push_back(field.find(element_name("tex_pages", i)));
    for (int number = 0; number < field.field_count; ++number)
      leak_.push_back(leaks ? leaked_value(h.statistics(request.field_at(number)), pool.layout.texels()) : 0);
  }

  void write(Page& page) {
    for (int number = 0; number < field_.field_count; ++number) {
      const PageContents contents = reader_.read(page, request_.field_at(number));
      write_page(options_, pool_.position(page.index), request_.storage, field_.scale_of(number), reader_.values(),
                 *pools_[static_cast<std::size_t>(pool_.texture_of(page.index) * field_.field_count + number)]);
      if (validity_ != nullptr) reader_.write_validity(page, validity_words(page, number));
      if (number == 0 && request_.needs.value_ranges) page.green = coded_range(contents);
      more_ranges_.set(page.index, number, range_of(contents, number));
    }
  }

 private:
  /// A page's words of all fields stand side by side.
  std::uint32_t* validity_words(const Page& page, int number) {
    return validity_->as<std::uint32_t>() + (page.index * field_.field_count + number) * options_.page_words();
  }
  /// Of what a field can return in a page; empty where it has no value.
  ValueRange range_of(const PageContents& c, int number) const {
    const double leak = leak_[static_cast<std::size_t>(number)];
    return c.any ? ValueRange{c.range.min - leak, c.range.max + leak} : ValueRange{};
  }
  std::uint32_t coded_range(const PageContents& c) const { return encode_range(field_, 0, range_of(c, 0)); }

  const BuildRequest& request_;
  const Options& options_;
  const PagePool& pool_;
  const EncodedField& field_;
  PageReader reader_;
  std::vector<HostTexture*> pools_;  ///< of each texture of the pool one a field, all laid out in the same way
  HostTexture* validity_;            ///< null where every cell has a value
  MoreRanges more_ranges_;
  std::vector<double> leak_;  ///< of each field
};

/// Reads the stored pages once more, to store them.
inline void store_pages(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const PagePool& pool,
                        std::vector<Page>& pages, EncodedField& field) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pages.size(), 8), [&](const auto& range) {
    PageWriter writer(h, request, o, pool, field);
    for (std::size_t i = range.begin(); i != range.end(); ++i)
      if (pages[i].kind == AMRTEX_PAGE_STORED) writer.write(pages[i]);
  });
}

struct Entry {
  std::uint32_t red = 0;
  std::uint32_t green = 0;
};

inline void write_entry(HostTexture& texture, const Vec3i& texel, const Entry& entry) {
  const std::size_t i = Box{Vec3i(0), texture.size}.offset(texel);
  if (texture.format == TexelFormat::r32ui)
    texture.as<std::uint32_t>()[i] = entry.red;
  else
    texture.as<Entry>()[i] = entry;
}

inline Entry entry_of(const Page& page) { return {red_of(page.kind, page.level, page.index), page.green}; }
inline Entry pointer_to(std::uint32_t subtable) { return {red_of(AMRTEX_PAGE_SUBTABLE, 0, subtable), 0}; }

/// Writes the entries of one page into `table`, the box of entries (pages of `table_level`)
/// that stand in the texture from texel `at`.
inline void write_entries(const AmrHierarchy& h, const Page& page, int table_level, const Box& table, HostTexture& texture,
                          const Vec3i& at) {
  const int r = h.cell_width(page.level) / h.cell_width(table_level);
  const Entry entry = entry_of(page);
  for_each_cell(intersection(Box{page.index_in_level, page.index_in_level + Vec3i(1)}.refined(r), table),
                [&](const Vec3i& i) { write_entry(texture, i - table.lower + at, entry); });
}

/// One level or two.
inline void write_levels(const AmrHierarchy& h, const TablePlan& plan, const std::vector<Page>& pages, EncodedField& field) {
  HostTexture& top = *field.find("tex_page_table");
  HostTexture* lower = field.find("tex_page_subtables");
  const Box top_box{Vec3i(0), plan.top};
  std::map<std::size_t, std::uint32_t> subtables;  // by the entry that points to it
  for (const Page& page : pages) {
    if (page.level <= plan.top_level) {
      write_entries(h, page, plan.top_level, top_box, top, Vec3i(0));
      continue;
    }
    const Vec3i owner = page.index_in_level / (h.cell_width(plan.top_level) / h.cell_width(page.level));
    const auto [sub, added] = subtables.try_emplace(top_box.offset(owner), static_cast<std::uint32_t>(subtables.size()));
    if (added) write_entry(top, owner, pointer_to(sub->second));
    const Box entries = Box{owner, owner + Vec3i(1)}.refined(plan.sub_edge);
    write_entries(h, page, plan.finest_level, entries, *lower, plan.sub_layout.position(sub->second));
  }
}

/// A tree of tables. Where no page lies entries stay zero: absent, of level 0.
inline void write_tree(const TablePlan& plan, const std::vector<Page>& pages, EncodedField& field) {
  const TableTree& tree = *plan.tree;
  HostTexture& top = *field.find("tex_page_table");
  HostTexture* nodes = field.find("page_nodes");
  const auto write = [&](std::size_t stage, std::int64_t first, const Box& table, const Vec3i& at, const Entry& entry) {
    if (stage == 0) return write_entry(top, at, entry);
    std::uint32_t* words =
        nodes->as<std::uint32_t>() + plan.entry_words() * (first + static_cast<std::int64_t>(table.offset(at)));
    words[0] = entry.red;
    if (plan.green) words[1] = entry.green;
  };
  for (const Page& page : pages) {
    const EntryPlace place = tree.place(page);
    for_each_cell(place.entries, [&](const Vec3i& at) { write(place.stage, place.first, place.table, at, entry_of(page)); });
  }
  tree.for_each_subtable([&](std::size_t stage, const Vec3i& at, std::uint32_t subtable) {
    const auto [first, table] = tree.table_of(stage, at);
    write(stage, first, table, at, pointer_to(subtable));
  });
  HostTexture* stages = field.find("page_stages");
  for (std::size_t i = 1; i < tree.stages().size(); ++i) {
    stages->as<std::uint32_t>()[2 * (i - 1)] = static_cast<std::uint32_t>(tree.stages()[i].width);
    stages->as<std::uint32_t>()[2 * (i - 1) + 1] = static_cast<std::uint32_t>(tree.stages()[i].edge);
  }
}

inline void write_table(const AmrHierarchy& h, const TablePlan& plan, const std::vector<Page>& pages, EncodedField& field) {
  plan.tree ? write_tree(plan, pages, field) : write_levels(h, plan, pages, field);
}

}  // namespace amrtex::pages
