// The stages of the command line, each in its own file.
#pragma once

namespace CLI {
class App;
}

namespace rbvh {

struct Context;

void add_ingest(CLI::App& app, Context& context);
void add_build(CLI::App& app, Context& context);
void add_lod(CLI::App& app, Context& context);
void add_mesh(CLI::App& app, Context& context);
void add_tiles(CLI::App& app, Context& context);
void add_proxy(CLI::App& app, Context& context);
void add_render(CLI::App& app, Context& context);
void add_paint(CLI::App& app, Context& context);
void add_sample(CLI::App& app, Context& context);
void add_bake(CLI::App& app, Context& context);
void add_update(CLI::App& app, Context& context);
void add_trace(CLI::App& app, Context& context);
void add_batch(CLI::App& app, Context& context);
void add_info(CLI::App& app, Context& context);
void add_validate(CLI::App& app, Context& context);
void add_view(CLI::App& app, Context& context);
void add_devices(CLI::App& app, Context& context);

}  // namespace rbvh
