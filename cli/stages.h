// The stages of the command line, each in its own file.
#pragma once

namespace CLI {
class App;
}

namespace rbvh {

#define RBVH_STAGE __attribute__((weak))  // until every stage has landed

struct Context;

void add_ingest(CLI::App& app, Context& context) RBVH_STAGE;
void add_build(CLI::App& app, Context& context) RBVH_STAGE;
void add_render(CLI::App& app, Context& context) RBVH_STAGE;
void add_trace(CLI::App& app, Context& context) RBVH_STAGE;
void add_info(CLI::App& app, Context& context) RBVH_STAGE;
void add_validate(CLI::App& app, Context& context) RBVH_STAGE;
void add_devices(CLI::App& app, Context& context) RBVH_STAGE;

}  // namespace rbvh
