"""One page to look over the results of a batch: no server, no network, nothing beside it.

`service.picture` draws a mesh small, in the process that has it. `collecting` takes one record
after the other and keeps a bounded part of them, the `gallery`; `page` writes that into the
templates beside it. Needs the extra `report`.
"""
